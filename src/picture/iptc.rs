//! IPTC data in Photoshop image resources: APP13 of a JPEG, a field of a TIFF (Adobe Photoshop File
//! Formats Specification, Image Resource Blocks).

/// The beginning of an APP13 with image resources.
pub(super) const RESOURCES: &[u8] = b"Photoshop 3.0\0";
/// The number of the IPTC-NAA resource.
const IPTC: u16 = 1028;

/// Whether `resources` hold IPTC data. A resource is a signature, a number, a name and data; name
/// and data begin with their length and are padded to an even length.
pub(super) fn has_iptc(resources: &[u8]) -> bool {
    search(resources).unwrap_or(false)
}

fn search(mut resources: &[u8]) -> Option<bool> {
    loop {
        let (head, rest) = resources.split_at_checked(7)?;
        let (_name, rest) = rest.split_at_checked(usize::from(head[6]) | 1)?;
        let (&length, rest) = rest.split_first_chunk::<4>()?;
        let length = u32::from_be_bytes(length) as usize;
        if !head.starts_with(b"8BIM") {
            return Some(false);
        }
        if u16::from_be_bytes([head[4], head[5]]) == IPTC && length > 0 {
            return Some(true);
        }
        resources = rest.get(length.checked_next_multiple_of(2)?..)?;
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
    fn iptc_is_found_among_other_resources() {
        let size = resource(1005, b"", &[0; 16]);
        let words = resource(IPTC, b"", b"\x1c\x02\x50\0\x03Ada");
        for before in [&[][..], &size, &resource(1000, b"odd", b"odd"), &resource(1, b"ev", b"")] {
            let all = [before, &words].concat();
            assert!(has_iptc(&all) && !has_iptc(before));
            (0..before.len()).for_each(|cut| assert!(!has_iptc(&all[..cut])));
        }
        assert!(!has_iptc(&resource(IPTC, b"", b"")), "an empty one");
    }
}
