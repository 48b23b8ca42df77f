//! What is said of a photo whose result has not all of its file.

/// Said of a photo with an artist, a description or other words in it.
pub(super) const WORDS_LOST: &str = "words in the file outside its EXIF data, such as a comment, \
                                     artist, description, date or camera, cannot be carried over \
                                     into the result";
/// Said of a photo that states at how many dots per inch it is printed.
pub(super) const DENSITY_LOST: &str = "dots per inch cannot be carried over into the result";

/// Said of a TIFF with EXIF data, and of a photo that has any where its result is a TIFF.
pub(super) const EXIF_LOST: &str = "EXIF data cannot be carried over into the result";
