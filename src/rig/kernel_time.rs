//! Whether the kernel calls its calendar synchronised: adjtimex(2), `STA_UNSYNC`. Without a battery
//! clock this is the only sign that somebody has set the time since the board was switched on; NTP
//! daemons (timesyncd, chrony, ntpd) clear the flag.
#![allow(unsafe_code)] // One call into the C library; no crate of the tree wraps it.

/// Whether the calendar was set by the network. `false` where it cannot be asked.
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
