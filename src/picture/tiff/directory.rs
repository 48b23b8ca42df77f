//! One directory of a TIFF file.

use super::{BITS_PER_SAMPLE, File, SAMPLE_FORMAT, SAMPLES_PER_PIXEL};
use crate::picture::Flaw;

/// Most letters of a text that are read. Guess: enough for a name.
pub(crate) const LETTERS_MAX: usize = 128;

/// The entries of a directory; a tag that stands twice counts once, by its first entry.
pub(crate) struct Directory<'a> {
    pub(crate) file: &'a File<'a>,
    pub(crate) at: usize,
    /// Tag and place of each entry.
    pub(crate) entries: Vec<(u16, usize)>,
}

impl<'a> Directory<'a> {
    pub(crate) fn read(file: &'a File<'a>, at: usize) -> Result<Directory<'a>, Flaw> {
        let count = usize::from(file.u16(at)?);
        if count == 0 {
            return Err(file.damaged("a directory of no entries", "at least one"));
        }
        let places = (0..count).map(|n| at + 2 + 12 * n);
        let entries = places.map(|entry| Ok((file.u16(entry)?, entry)));
        let entries = entries.collect::<Result<Vec<_>, Flaw>>()?;
        Ok(Directory { file, at, entries })
    }

    /// The first directory of `file`.
    pub(crate) fn first(file: &'a File<'a>) -> Result<Directory<'a>, Flaw> {
        Directory::read(file, file.u32(4)? as usize)
    }

    /// The directory whose place is in the field `tag`, if it can be read.
    pub(crate) fn below(&self, tag: u16) -> Option<Directory<'a>> {
        Directory::read(self.file, self.number(tag).ok()??).ok()
    }

    /// Where the place of the next directory is stated.
    pub(crate) fn next_field(&self) -> usize {
        self.at + 2 + 12 * self.entries.len()
    }

    /// The place of the next directory; 0 after the last one.
    pub(crate) fn next(&self) -> Result<usize, Flaw> {
        self.file.u32(self.next_field()).map(|at| at as usize)
    }

    pub(crate) fn find(&self, tag: u16) -> Option<usize> {
        self.entries.iter().find(|(found, _)| *found == tag).map(|&(_, entry)| entry)
    }

    pub(crate) fn numbers(&self, tag: u16) -> Result<Option<Vec<usize>>, Flaw> {
        self.find(tag).map(|entry| self.file.numbers(entry)).transpose()
    }

    pub(crate) fn number(&self, tag: u16) -> Result<Option<usize>, Flaw> {
        self.find(tag).map(|entry| self.file.first(entry)).transpose()
    }

    /// The printable letters of a text, at most [`LETTERS_MAX`].
    pub(crate) fn text(&self, tag: u16) -> Result<Option<String>, Flaw> {
        let Some(entry) = self.find(tag) else { return Ok(None) };
        let (count, at) = self.file.place(entry, 1)?;
        let bytes = self.file.bytes.get(at..).unwrap_or_default().iter();
        let letters = bytes.take(count.min(LETTERS_MAX)).take_while(|&&b| b != 0);
        let printed = letters.filter(|b| (b' '..=b'~').contains(b)).map(|&b| char::from(b));
        Ok(Some(printed.collect::<String>().trim().to_owned()))
    }

    /// Whole, fractional or floating numbers.
    pub(crate) fn reals(&self, tag: u16) -> Result<Option<Vec<f32>>, Flaw> {
        let Some(entry) = self.find(tag) else { return Ok(None) };
        let (file, kind) = (self.file, self.file.u16(entry + 2)?);
        let width = match kind {
            11 => 4,
            5 | 10 | 12 => 8,
            _ => return Ok(Some(file.numbers(entry)?.into_iter().map(|v| v as f32).collect())),
        };
        let (count, at) = file.values(entry, width)?;
        let real = |at: usize| match kind {
            11 => file.u32(at).map(f32::from_bits),
            12 => file.f64(at).map(|v| v as f32),
            _ => {
                let (above, below) = (file.u32(at)?, file.u32(at + 4)?);
                // Type 10 has signs.
                let number = |v: u32| if kind == 10 { f64::from(v as i32) } else { f64::from(v) };
                Ok((number(above) / number(below)) as f32)
            }
        };
        (0..count).map(|n| real(at + width * n)).collect::<Result<_, Flaw>>().map(Some)
    }
}

/// The samples of the first picture in words, for a decoder that does not read them.
pub(crate) fn samples_of(bytes: &[u8]) -> Option<String> {
    let file = File::new(bytes);
    let directory = Directory::first(&file).ok()?;
    let number = |tag| directory.number(tag).ok().flatten().unwrap_or(1);
    let kind = match number(SAMPLE_FORMAT) {
        2 => "signed numbers",
        3 => "numbers with fractions",
        _ => "numbers",
    };
    let (count, bits) = (number(SAMPLES_PER_PIXEL), number(BITS_PER_SAMPLE));
    Some(format!("{count} {kind} of {bits} bits a pixel"))
}
