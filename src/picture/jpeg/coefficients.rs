//! A JPEG's quantised coefficients and steps, which the decoder does not give.
//!
//! Supported (ITU-T T.81): sequential and progressive Huffman coding of 8 bits, one component or
//! three, the last two perhaps at half the width, height or both. Other JPEGs are solved from their
//! decoded pixels. Memory is bounded by [`AREA_MAX`], and time by [`SCANS_MAX`] passes over it.

use std::sync::Arc;

use super::super::Flaw;
use super::huffman::HuffmanCodes;
use super::scan::{Scan, ScanBlocks, ScanPart, ZIGZAG};
use super::{SCAN, Segment, Segments, damaged, frame_header};
use crate::frame::{BLOCK_AREA, BLOCK_PX, CodedComponent, Coding, Size};

/// Most scans of one picture. Guess: progressive coders write ten.
const SCANS_MAX: usize = 64;
/// Most pixels, twice the usual limit of photos. Guess.
const AREA_MAX: usize = 1 << 26;

/// The tables in force at one place of a file, and the picture read so far.
#[derive(Default)]
struct CodedFile {
    steps: [Option<Vec<u16>>; 4],
    dc: [Option<HuffmanCodes>; 4],
    ac: [Option<HuffmanCodes>; 4],
    restart: usize,
    /// Whether the components are red, green and blue, by Adobe's marker.
    is_rgb: bool,
    frame: Option<CodedFrame>,
    /// Whether the blocks of each scan so far ended where its data end.
    fills_scans: bool,
}

/// The picture being read.
struct CodedFrame {
    progressive: bool,
    size: Size,
    /// Blocks of the densest component in a unit (MCU), across and down.
    densest: (u8, u8),
    heads: Vec<ComponentHeader>,
    components: Vec<CodedComponent>,
}

/// A component in the frame header (T.81, B.2.2).
struct ComponentHeader {
    identifier: u8,
    /// Blocks of the component in a unit (MCU), across and down.
    sampling: (u8, u8),
    steps: usize,
}

/// Why a JPEG's coefficients are not read.
enum Unread {
    /// The file is of a kind that is not read.
    Kind,
    /// Its codes are invalid from a unit on; the unit's index and the number of units in the scan.
    Broken(usize, usize),
}

/// The coefficients and steps of the JPEG `bytes`; `None` for a kind that is not read.
///
/// # Errors
/// [`Flaw::Damaged`] for invalid codes, or codes for another number of blocks than the picture has.
pub(crate) fn coefficients(bytes: &[u8]) -> Result<Option<Coding>, Flaw> {
    let found = match read(bytes) {
        Ok(file) if file.fills_scans => return Ok(coding_of(file)),
        Err(Unread::Kind) => return Ok(None),
        Ok(_) => "codes for another number of blocks than the picture has".to_owned(),
        Err(Unread::Broken(unit, units)) => {
            format!("invalid codes after {unit} of {units} coding units of a scan")
        }
    };
    Err(damaged(&found, "codes for the whole picture"))
}

/// The result of [`coefficients`] for a JPEG with long runs of zeros. The outer `None` means that
/// its scans cannot be decoded to their last block, so that the zeros are a hole.
pub(crate) fn coefficients_with_zeros(bytes: &[u8]) -> Option<Option<Coding>> {
    read(bytes).ok().filter(|file| file.fills_scans).map(coding_of)
}

fn coding_of(file: CodedFile) -> Option<Coding> {
    let CodedFile { is_rgb, frame, .. } = file;
    let CodedFrame { size, components, heads, .. } = frame?;
    // Components named R, G and B are not brightness and colour differences.
    let is_rgb = is_rgb && heads.len() > 1 || heads.iter().map(|h| h.identifier).eq(*b"RGB");
    let is_dense = |head: &ComponentHeader| head.sampling.0.max(head.sampling.1) <= 2;
    if is_rgb || !matches!(heads.len(), 1 | 3) || !heads.iter().all(is_dense) {
        return None;
    }
    let coding = Coding { size, components };
    coding.is_whole().then_some(coding)
}

fn read(bytes: &[u8]) -> Result<CodedFile, Unread> {
    let mut state = CodedFile { fills_scans: true, ..CodedFile::default() };
    let mut scans = 0;
    for segment in Segments::new(bytes) {
        let Segment { marker, body, coded } = segment.map_err(|_| Unread::Kind)?;
        match marker {
            0xc0..=0xc2 if state.frame.is_none() => {
                state.frame = Some(frame_of(body, marker == 0xc2).ok_or(Unread::Kind)?);
            }
            0xc4 => state.read_codes(body).ok_or(Unread::Kind)?,
            0xc3 | 0xc5..=0xcf | 0xc0..=0xc2 => return Err(Unread::Kind),
            0xdb => state.read_steps(body).ok_or(Unread::Kind)?,
            0xdd => state.restart = u16_at(body, 0).ok_or(Unread::Kind)?.into(),
            0xee if body.starts_with(b"Adobe") => state.is_rgb = body.get(11) == Some(&0),
            SCAN => {
                scans += 1;
                let end = state.read_scan(body, bytes, coded.start)?;
                let rest = bytes.get(end..coded.end).unwrap_or(&[0]);
                state.fills_scans &= is_filling(rest);
                if scans > SCANS_MAX {
                    return Err(Unread::Kind);
                }
            }
            _ => {}
        }
    }
    Ok(state)
}

/// Whether `rest`, the bytes after the last block, are fill bytes (B.1.1.2). A restart marker at
/// their end is allowed, as some cameras write it.
fn is_filling(rest: &[u8]) -> bool {
    let rest = match rest {
        [rest @ .., 0xff, 0xd0..=0xd7] => rest,
        rest => rest,
    };
    rest.iter().all(|&b| b == 0xff)
}

fn u16_at(bytes: &[u8], at: usize) -> Option<u16> {
    Some(u16::from_be_bytes([*bytes.get(at)?, *bytes.get(at + 1)?]))
}

/// The picture of a frame header, all coefficients zero (T.81, B.2.2).
fn frame_of(body: &[u8], progressive: bool) -> Option<CodedFrame> {
    let (size, components) = frame_header(body).ok()?;
    let count = usize::from(components);
    let head = |c: &[u8]| {
        let sampling = (c[1] >> 4, c[1] & 15);
        ComponentHeader { identifier: c[0], sampling, steps: usize::from(c[2]) }
    };
    let heads: Vec<_> = body.get(6..)?.chunks_exact(3).map(head).collect();
    let few = (1..=4).contains(&count) && heads.len() == count;
    if !few || size.area() > AREA_MAX {
        return None;
    }
    let densest = if count == 1 { (1, 1) } else { heads[0].sampling };
    let divides = |(across, down): (u8, u8)| {
        count == 1 || (across > 0 && down > 0 && densest.0 % across == 0 && densest.1 % down == 0)
    };
    // T.81, table B.2.
    let sound = (1..=4).contains(&densest.0) && (1..=4).contains(&densest.1);
    if !sound || !heads.iter().all(|head| divides(head.sampling)) {
        return None;
    }
    let component = |head: &ComponentHeader| {
        let (across, down) = head.sampling;
        let pixels = if count == 1 { (1, 1) } else { (densest.0 / across, densest.1 / down) };
        let blocks = Coding::blocks(size, densest, pixels);
        let coefficients = Arc::new(vec![0; blocks.area() * BLOCK_AREA]);
        CodedComponent { pixels, blocks, steps: Vec::new(), coefficients }
    };
    let components = heads.iter().map(component).collect();
    Some(CodedFrame { progressive, size, densest, components, heads })
}

impl CodedFrame {
    /// The scan with the header fields `first`, `last` and `bit`, of `count` components.
    fn scan(&self, [first, last, bit]: [u8; 3], count: usize) -> Option<Scan> {
        if !self.progressive {
            let band = (0, BLOCK_AREA - 1);
            return Some(Scan { progressive: false, band, high: 0, low: 0 });
        }
        let band = (usize::from(first), usize::from(last));
        let (high, low) = (u32::from(bit >> 4), u32::from(bit & 15));
        let is_sound = band.0 <= band.1 && band.1 < BLOCK_AREA && low < 14;
        let is_alone = band.0 == 0 || count == 1;
        (is_sound && is_alone).then_some(Scan { progressive: true, band, high, low })
    }

    /// Columns and rows of units in a scan of the components `parts`.
    fn units(&self, parts: &[ScanPart]) -> Size {
        let [ScanPart { component, .. }] = *parts else {
            return Coding::blocks(self.size, self.densest, self.densest);
        };
        // A single component is coded block by block, without padding blocks (A.2.2).
        let (across, down) = self.components[component].pixels;
        let blocks =
            |side: usize, pixels: u8| side.div_ceil(usize::from(pixels)).div_ceil(BLOCK_PX);
        Size::new(blocks(self.size.width, across), blocks(self.size.height, down))
    }
}

impl CodedFile {
    /// Reads the codes of a DHT segment.
    fn read_codes(&mut self, mut segment: &[u8]) -> Option<()> {
        while let [head, rest @ ..] = segment {
            let counts: &[u8; 16] = rest.first_chunk()?;
            let total = counts.iter().map(|&count| usize::from(count)).sum::<usize>();
            let values = rest.get(16..16 + total)?;
            let tables = if head >> 4 == 0 { &mut self.dc } else { &mut self.ac };
            *tables.get_mut(usize::from(head & 15))? = Some(HuffmanCodes::new(counts, values));
            segment = &rest[16 + total..];
        }
        Some(())
    }

    /// Reads the steps of a DQT segment, row by row.
    fn read_steps(&mut self, mut segment: &[u8]) -> Option<()> {
        while let [head, rest @ ..] = segment {
            let bytes = if head >> 4 == 0 { 1 } else { 2 };
            let values = rest.get(..bytes * BLOCK_AREA)?;
            let mut steps = vec![0; BLOCK_AREA];
            for (value, place) in values.chunks_exact(bytes).zip(ZIGZAG) {
                steps[usize::from(place)] =
                    value.iter().fold(0, |sum, &byte| sum << 8 | u16::from(byte));
            }
            *self.steps.get_mut(usize::from(head & 15))? = Some(steps);
            segment = &rest[bytes * BLOCK_AREA..];
        }
        Some(())
    }

    /// Reads the scan with the header `body`, whose data begin at `at`; returns where they end.
    fn read_scan(&mut self, body: &[u8], bytes: &[u8], at: usize) -> Result<usize, Unread> {
        let (scan, parts) = self.scan_header(body).ok_or(Unread::Kind)?;
        // Without code tables, as in Motion JPEG, a scan cannot be read.
        if !scan.progressive && parts.iter().any(|part| part.dc.is_none() || part.ac.is_none()) {
            return Err(Unread::Kind);
        }
        let frame = self.frame.as_mut().ok_or(Unread::Kind)?;
        let (units, densest) = (frame.units(&parts), frame.densest);
        let mut blocks = ScanBlocks::new(scan, bytes, at);
        for unit in 0..units.area() {
            let broken = || Unread::Broken(unit, units.area());
            if self.restart > 0 && unit > 0 && unit % self.restart == 0 {
                blocks.restart().ok_or_else(broken)?;
            }
            let (column, row) = (unit % units.width, unit / units.width);
            for part in &parts {
                let component = &mut frame.components[part.component];
                let (across, down) = component.pixels;
                let (wide, high) = match parts.len() {
                    1 => (1, 1),
                    _ => (usize::from(densest.0 / across), usize::from(densest.1 / down)),
                };
                for n in 0..wide * high {
                    let (x, y) = (column * wide + n % wide, row * high + n / wide);
                    let begin = (y * component.blocks.width + x) * BLOCK_AREA;
                    let all = Arc::make_mut(&mut component.coefficients);
                    let block = all.get_mut(begin..begin + BLOCK_AREA).ok_or(Unread::Kind)?;
                    blocks.read(part, block).ok_or_else(broken)?;
                }
            }
        }
        Ok(blocks.end())
    }

    /// The scan and its components with the header `body`.
    fn scan_header(&mut self, body: &[u8]) -> Option<(Scan, Vec<ScanPart>)> {
        let count = usize::from(*body.first()?);
        let fields = *body.get(1 + 2 * count..)?.first_chunk()?;
        let scan = self.frame.as_ref()?.scan(fields, count)?;
        Some((scan, self.scan_parts(body.get(1..1 + 2 * count)?)?))
    }

    /// The components of a scan that `listed` names, with their tables; fixes the steps of each.
    fn scan_parts(&mut self, listed: &[u8]) -> Option<Vec<ScanPart>> {
        let frame = self.frame.as_mut()?;
        let mut parts: Vec<ScanPart> = Vec::with_capacity(listed.len() / 2);
        for which in listed.chunks_exact(2) {
            let n = frame.heads.iter().position(|head| head.identifier == which[0])?;
            if parts.iter().any(|part| part.component == n) {
                return None;
            }
            let component = &mut frame.components[n];
            if component.steps.is_empty() {
                component.steps = self.steps.get(frame.heads[n].steps)?.clone()?;
            }
            let table =
                |tables: &[Option<HuffmanCodes>; 4], at: u8| tables.get(usize::from(at)).cloned();
            let (dc, ac) = (table(&self.dc, which[1] >> 4)?, table(&self.ac, which[1] & 15)?);
            parts.push(ScanPart { component: n, dc, ac });
        }
        Some(parts)
    }
}
