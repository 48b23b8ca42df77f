//! One directory of a TIFF file: its entries by their tags, and where the next one is.

use super::super::Flaw;
use super::super::tiff::File;

/// Letters of a text that are read. Guess: enough of a name.
pub(super) const LETTERS_MAX: usize = 128;

/// A directory's entries.
pub(super) struct Directory<'a> {
    pub(super) file: &'a File<'a>,
    pub(super) at: usize,
    /// Tag and place of each entry.
    pub(super) entries: Vec<(u16, usize)>,
    pub(super) next: usize,
}

impl<'a> Directory<'a> {
    pub(super) fn read(file: &'a File<'a>, at: usize) -> Result<Directory<'a>, Flaw> {
        let count = usize::from(file.u16(at)?);
        if count == 0 {
            // As a file does that was given its room before its bytes.
            let flaw = file.ended_early("a directory");
            let room = matches!(flaw, Flaw::ZeroFilled { .. });
            let damaged = || file.damaged("a directory of no entries", "at least one");
            return Err(if room { flaw } else { damaged() });
        }
        let places = (0..count).map(|n| at + 2 + 12 * n);
        let entries = places.map(|entry| Ok((file.u16(entry)?, entry)));
        let entries = entries.collect::<Result<Vec<_>, Flaw>>()?;
        let next = file.u32(at + 2 + 12 * count)? as usize;
        Ok(Directory { file, at, entries, next })
    }

    pub(super) fn find(&self, tag: u16) -> Option<usize> {
        self.entries.iter().find(|(found, _)| *found == tag).map(|&(_, entry)| entry)
    }

    pub(super) fn numbers(&self, tag: u16) -> Result<Option<Vec<usize>>, Flaw> {
        self.find(tag).map(|entry| self.file.numbers(entry)).transpose()
    }

    pub(super) fn number(&self, tag: u16) -> Result<Option<usize>, Flaw> {
        self.find(tag).map(|entry| self.file.first(entry)).transpose()
    }

    /// Text as far as it can be printed, up to its closing zero or [`LETTERS_MAX`].
    pub(super) fn text(&self, tag: u16) -> Result<Option<String>, Flaw> {
        let Some(entry) = self.find(tag) else { return Ok(None) };
        let (count, at) = self.file.place(entry, 1)?;
        let bytes = self.file.bytes.get(at..).unwrap_or_default().iter();
        let letters = bytes.take(count.min(LETTERS_MAX)).take_while(|&&b| b != 0);
        let printed = letters.filter(|b| (b' '..=b'~').contains(b)).map(|&b| char::from(b));
        Ok(Some(printed.collect::<String>().trim().to_owned()))
    }

    /// Numbers that may be fractions, with a sign or without, or floating.
    pub(super) fn reals(&self, tag: u16) -> Result<Option<Vec<f32>>, Flaw> {
        let Some(entry) = self.find(tag) else { return Ok(None) };
        let kind = self.file.u16(entry + 2)?;
        if kind == 12 {
            let (count, at) = self.file.place(entry, 8)?;
            let double = |n: usize| self.file.f64(at + 8 * n).map(|v| v as f32);
            return (0..count).map(double).collect::<Result<Vec<_>, Flaw>>().map(Some);
        }
        if kind != 5 && kind != 10 {
            let whole = self.file.numbers(entry)?;
            return Ok(Some(whole.into_iter().map(|v| v as f32).collect()));
        }
        let (count, at) = self.file.place(entry, 8)?;
        let fraction = |n: usize| {
            let (above, below) = (self.file.u32(at + 8 * n)?, self.file.u32(at + 8 * n + 4)?);
            // Type 10 has signs.
            let number = |v: u32| if kind == 10 { f64::from(v as i32) } else { f64::from(v) };
            Ok((number(above) / number(below)) as f32)
        };
        (0..count).map(fraction).collect::<Result<Vec<_>, Flaw>>().map(Some)
    }
}
