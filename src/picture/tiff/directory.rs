//! One directory of a TIFF file.

use super::{BITS_PER_SAMPLE, File, SAMPLE_FORMAT, SAMPLES_PER_PIXEL, VALUES_MAX};
use crate::picture::Flaw;

/// Most letters that are read of a text. Guess: enough for a name.
pub(crate) const LETTERS_MAX: usize = 128;

/// The entries of a directory. If a tag occurs twice, its first entry is used.
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

    /// Place of the field that holds the place of the next directory.
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

    /// The printable letters of the text in the field `tag`, at most [`LETTERS_MAX`].
    pub(crate) fn text(&self, tag: u16) -> Result<Option<String>, Flaw> {
        let Some(entry) = self.find(tag) else { return Ok(None) };
        let (count, at) = self.file.place(entry, 1)?;
        let bytes = self.file.bytes.get(at..).unwrap_or_default().iter();
        let letters = bytes.take(count.min(LETTERS_MAX)).take_while(|&&b| b != 0);
        let printed = letters.filter(|b| (b' '..=b'~').contains(b)).map(|&b| char::from(b));
        Ok(Some(printed.collect::<String>().trim().to_owned()))
    }

    /// The numbers in the field `tag`, be they integers, fractions or floating-point.
    pub(crate) fn reals(&self, tag: u16) -> Result<Option<Vec<f32>>, Flaw> {
        let Some(entry) = self.find(tag) else { return Ok(None) };
        let Field { kind, bytes, .. } = Field::read(self.file, entry, VALUES_MAX)?;
        let words = bytes.as_chunks::<4>().0;
        // Type 10 (SRATIONAL) is signed.
        let part = |word: [u8; 4]| match kind {
            10 => f64::from(i32::from_le_bytes(word)),
            _ => f64::from(u32::from_le_bytes(word)),
        };
        Ok(Some(match kind {
            11 => words.iter().map(|&word| f32::from_le_bytes(word)).collect(),
            12 => bytes.as_chunks().0.iter().map(|&long| f64::from_le_bytes(long) as f32).collect(),
            5 | 10 => words.chunks_exact(2).map(|w| (part(w[0]) / part(w[1])) as f32).collect(),
            _ => self.file.numbers(entry)?.into_iter().map(|v| v as f32).collect(),
        }))
    }
}

/// A field: its type, number of values, and bytes in little-endian order.
#[derive(Debug, Clone)]
pub(crate) struct Field {
    pub(crate) kind: u16,
    pub(crate) count: usize,
    pub(crate) bytes: Vec<u8>,
}

impl Field {
    /// The field of the entry at `entry`, of at most `count_max` values.
    pub(crate) fn read(file: &File<'_>, entry: usize, count_max: usize) -> Result<Field, Flaw> {
        let kind = file.u16(entry + 2)?;
        // Bytes of a value, and of the numbers that it is made of.
        let (width, number) = match kind {
            1 | 2 | 6 | 7 => (1, 1),
            3 | 8 => (2, 2),
            4 | 9 | 11 | 13 => (4, 4),
            5 | 10 => (8, 4),
            12 => (8, 8),
            other => return Err(file.damaged(&format!("a field of type {other}"), "SHORT or LONG")),
        };
        let (count, at) = file.place(entry, width)?;
        if count > count_max {
            let found = format!("a field of {count} values");
            return Err(file.damaged(&found, &format!("at most {count_max}")));
        }
        let end = count.checked_mul(width).and_then(|length| length.checked_add(at));
        let bytes = end.and_then(|end| file.bytes.get(at..end));
        let bytes = bytes.ok_or_else(|| file.ended_early("a directory past the end"))?;
        let mut bytes = bytes.to_vec();
        if file.big_endian {
            bytes.chunks_exact_mut(number).for_each(<[u8]>::reverse);
        }
        Ok(Field { kind, count, bytes })
    }
}

/// A description of the first picture's samples, for the message that they are not read.
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
