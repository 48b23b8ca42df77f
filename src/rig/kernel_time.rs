//! Synchronisation of the kernel's calendar: adjtimex(2), `STA_UNSYNC`. NTP daemons (timesyncd,
//! chrony, ntpd) clear the flag; without a battery clock nothing else shows that the time was set.
#![allow(unsafe_code)] // One call into the C library; no crate of the tree wraps it.

/// Whether the network has set the calendar; `false` if this is unknown.
pub fn is_synchronised() -> bool {
    // SAFETY: all-zero is a valid `timex` (plain integers) and, with `modes` 0, asks and changes
    // nothing; the pointer is to a live value of the right type.
    let (state, asked) = unsafe {
        let mut asked: libc::timex = std::mem::zeroed();
        (libc::adjtimex(&mut asked), asked)
    };
    // adjtimex returns TIME_ERROR as long as STA_UNSYNC is set, and -1 where it is forbidden.
    state >= 0 && asked.status & libc::STA_UNSYNC == 0
}
