//! A JPEG's coefficients and steps out of the file, which no decoder in the tree gives.
//!
//! ITU-T T.81: sequential and progressive, Huffman coding, 8 bits, one component or three of which
//! the last two may be stored at half the width, height or both. Whatever else there is gives
//! nothing, and the photo is taken as its decoder shows it. Memory is bounded by the picture's
//! size, which the walk before has checked, and time by [`SCANS_MAX`] passes over it.

use super::huffman::{Bits, HuffmanCodes};
use super::scan::{Running, Scan, Tables, ZIGZAG};
use super::{end_of_scan, next_marker, segment};
use crate::frame::{BLOCK_AREA, BLOCK_PX, CodedComponent, Coding, Size};

/// Most scans of one picture. Guess: progressive coders write ten.
const SCANS_MAX: usize = 64;

/// What the tables of a file hold at one place in it.
#[derive(Default)]
struct CodedFile {
    steps: [Option<Vec<u16>>; 4],
    dc: [Option<HuffmanCodes>; 4],
    ac: [Option<HuffmanCodes>; 4],
    restart: usize,
    /// Whether colours were not changed to brightness and two differences, as Adobe's marker says.
    colours_kept: bool,
    frame: Option<CodedFrame>,
}

/// The picture under way.
struct CodedFrame {
    progressive: bool,
    size: Size,
    /// Identifier, samples of a unit across and down, place of its steps.
    heads: Vec<(u8, (u8, u8), usize)>,
    components: Vec<CodedComponent>,
}

/// What the JPEG `bytes` states, if it is of a kind that is understood and all there.
pub(in crate::picture) fn coefficients(bytes: &[u8]) -> Option<Coding> {
    let mut state = CodedFile::default();
    let (mut at, mut scans) = (2, 0);
    loop {
        let marker = next_marker(bytes, &mut at).ok()?;
        match marker {
            0xd9 => break,
            0x01 | 0xd0..=0xd8 => continue,
            _ => {}
        }
        let segment = segment(bytes, at).ok()?;
        at += segment.len() + 2;
        match marker {
            0xc0..=0xc2 if state.frame.is_none() => {
                state.frame = Some(frame_of(segment, marker == 0xc2)?);
            }
            0xc4 => state.take_codes(segment)?,
            0xc3 | 0xc5..=0xcf | 0xc0..=0xc2 => return None,
            0xdb => state.take_steps(segment)?,
            0xdd => state.restart = usize::from(u16_at(segment, 0)?),
            0xee if segment.starts_with(b"Adobe") => {
                state.colours_kept = segment.get(11) == Some(&0);
            }
            0xda => {
                scans += 1;
                state.scan(segment, bytes, at).filter(|()| scans <= SCANS_MAX)?;
                at = end_of_scan(bytes, at);
            }
            _ => {}
        }
    }
    let frame = state.frame.filter(|f| f.heads.len() == 1 || !state.colours_kept)?;
    let coding = Coding { size: frame.size, components: frame.components };
    coding.is_whole().then_some(coding)
}

fn u16_at(bytes: &[u8], at: usize) -> Option<u16> {
    Some(u16::from_be_bytes([*bytes.get(at)?, *bytes.get(at + 1)?]))
}

/// The frame header's picture, all coefficients zero (T.81, B.2.2).
fn frame_of(segment: &[u8], progressive: bool) -> Option<CodedFrame> {
    let size = Size::new(u16_at(segment, 3)?.into(), u16_at(segment, 1)?.into());
    let count = usize::from(*segment.get(5)?);
    let heads: Vec<_> = (segment.get(6..)?.chunks_exact(3))
        .map(|c| (c[0], (c[1] >> 4, c[1] & 15), usize::from(c[2])))
        .collect();
    let few = matches!(count, 1 | 3) && heads.len() == count && size.area() > 0;
    // Three colours that say so by their names are no brightness and two differences.
    if segment.first() != Some(&8) || !few || heads.iter().map(|h| h.0).eq(*b"RGB") {
        return None;
    }
    let densest = if count == 1 { (1, 1) } else { heads[0].1 };
    let whole = |(across, down): (u8, u8)| {
        count == 1 || (across > 0 && down > 0 && densest.0 % across == 0 && densest.1 % down == 0)
    };
    let sound = (1..=2).contains(&densest.0) && (1..=2).contains(&densest.1);
    if !sound || !heads.iter().all(|head| whole(head.1)) {
        return None;
    }
    let components = heads.iter().map(|&(_, (across, down), _)| {
        let pixels = if count == 1 { (1, 1) } else { (densest.0 / across, densest.1 / down) };
        let blocks = Coding::blocks(size, densest, pixels);
        let coefficients = vec![0; blocks.area() * BLOCK_AREA];
        CodedComponent { pixels, blocks, steps: Vec::new(), coefficients }
    });
    Some(CodedFrame { progressive, size, components: components.collect(), heads })
}

impl CodedFile {
    /// The codes of a DHT segment.
    fn take_codes(&mut self, mut segment: &[u8]) -> Option<()> {
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

    /// The steps of a DQT segment, row by row.
    fn take_steps(&mut self, mut segment: &[u8]) -> Option<()> {
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

    /// The scan with the header `segment`, whose data begin at `at`.
    fn scan(&mut self, segment: &[u8], bytes: &[u8], at: usize) -> Option<()> {
        let frame = self.frame.as_mut()?;
        let count = usize::from(*segment.first()?);
        let [first, last, bit] = *segment.get(1 + 2 * count..)?.first_chunk()?;
        let band = (usize::from(first), usize::from(last));
        let (high, low) = (u32::from(bit >> 4), u32::from(bit & 15));
        let scan = match frame.progressive {
            true => Scan { progressive: true, band, high, low },
            false => Scan { progressive: false, band: (0, BLOCK_AREA - 1), high: 0, low: 0 },
        };
        let bands = band.0 <= band.1 && band.1 < BLOCK_AREA && low < 14;
        let alone = !frame.progressive || band.0 == 0 || count == 1;
        if frame.progressive && !(bands && alone) {
            return None;
        }
        let mut taken = Vec::with_capacity(count);
        for which in segment.get(1..1 + 2 * count)?.chunks_exact(2) {
            let n = frame.heads.iter().position(|head| head.0 == which[0])?;
            if taken.iter().any(|&(other, _)| other == n) {
                return None;
            }
            let component = &mut frame.components[n];
            if component.steps.is_empty() {
                component.steps = self.steps.get(frame.heads[n].2)?.clone()?;
            }
            let table =
                |of: &'_ [Option<HuffmanCodes>; 4], at: u8| of.get(usize::from(at)).cloned();
            let dc = table(&self.dc, which[1] >> 4)?;
            taken.push((n, (dc, table(&self.ac, which[1] & 15)?)));
        }
        let size = frame.size;
        let (mut bits, mut running) = (Bits::new(bytes, at), Running::default());
        let densest = if frame.components.len() == 1 { (1, 1) } else { frame.heads[0].1 };
        let units = match taken[..] {
            // A component by itself comes block by block, without those that fill up (A.2.2).
            [(n, _)] => {
                let (across, down) = frame.components[n].pixels;
                let of =
                    |side: usize, pixels: u8| side.div_ceil(usize::from(pixels)).div_ceil(BLOCK_PX);
                Size::new(of(size.width, across), of(size.height, down))
            }
            _ => Coding::blocks(size, densest, densest),
        };
        for unit in 0..units.area() {
            if self.restart > 0 && unit > 0 && unit % self.restart == 0 {
                bits.restart()?;
                running = Running::default();
            }
            let (column, row) = (unit % units.width, unit / units.width);
            for (n, (dc, ac)) in &taken {
                let tables = Tables { dc: dc.as_ref(), ac: ac.as_ref() };
                let component = &mut frame.components[*n];
                let (across, down) = component.pixels;
                let (wide, high) = match taken.len() {
                    1 => (1, 1),
                    _ => (usize::from(densest.0 / across), usize::from(densest.1 / down)),
                };
                for part in 0..wide * high {
                    let x = column * wide + part % wide;
                    let y = row * high + part / wide;
                    let begin = (y * component.blocks.width + x) * BLOCK_AREA;
                    let block = component.coefficients.get_mut(begin..begin + BLOCK_AREA)?;
                    scan.block(&mut bits, &tables, (&mut running, *n), block)?;
                }
            }
        }
        Some(())
    }
}
