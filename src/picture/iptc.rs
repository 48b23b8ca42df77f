//! Whether a photo's image resources hold what IPTC's tags say of it (Adobe Photoshop File Formats
//! Specification, Image Resource Blocks): JPEGs have them in APP13, TIFFs in a field of their own.

/// Said of a photo with such data.
pub(super) const IPTC_LOST: &str = "IPTC data cannot be carried over into the result";
/// What APP13 begins with where it holds image resources.
pub(super) const RESOURCES: &[u8] = b"Photoshop 3.0\0";
/// The resource of IPTC's data, IPTC-NAA.
const IPTC: u16 = 1028;

/// Whether `resources`, one after the other, hold IPTC's data: a signature, a number, a name and
/// data, both with their length before them and filled up to an even one.
pub(super) fn is_in(mut resources: &[u8]) -> bool {
    loop {
        let Some((head, rest)) = resources.split_at_checked(7) else { return false };
        let Some((_name, rest)) = rest.split_at_checked(usize::from(head[6]) | 1) else {
            return false;
        };
        let Some((&length, rest)) = rest.split_first_chunk::<4>() else { return false };
        let length = u32::from_be_bytes(length) as usize;
        if !head.starts_with(b"8BIM") {
            return false;
        }
        if u16::from_be_bytes([head[4], head[5]]) == IPTC && length > 0 {
            return true;
        }
        let Some(next) = length.checked_next_multiple_of(2).and_then(|at| rest.get(at..)) else {
            return false;
        };
        resources = next;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn resource(number: u16, name: &[u8], data: &[u8]) -> Vec<u8> {
        let mut bytes = b"8BIM".to_vec();
        bytes.extend(number.to_be_bytes());
        bytes.push(name.len() as u8);
        bytes.extend(name);
        bytes.resize(bytes.len().next_multiple_of(2), 0);
        bytes.extend((data.len() as u32).to_be_bytes());
        bytes.extend(data);
        bytes.resize(bytes.len().next_multiple_of(2), 0);
        bytes
    }

    #[test]
    fn iptc_is_found_behind_other_resources_and_nothing_else_is_taken_for_it() {
        let size = resource(1005, b"", &[0; 16]);
        let words = resource(IPTC, b"", b"\x1c\x02\x50\0\x03Ada");
        for before in [&[][..], &size, &resource(1000, b"odd", b"odd"), &resource(1, b"ev", b"")] {
            let all = [before, &words].concat();
            assert!(is_in(&all) && !is_in(before));
            (0..before.len()).for_each(|cut| assert!(!is_in(&all[..cut])));
        }
        assert!(!is_in(&resource(IPTC, b"", b"")), "an empty one");
    }
}
