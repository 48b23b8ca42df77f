//! A value computed on first use, by several threads.

use std::sync::OnceLock;

/// The value in `lock`, initialised by `make`.
///
/// `get_or_init` could deadlock: while a thread waits for others within `make`, rayon may run
/// another job on it that needs the same value. Here the value is computed twice in that case, and
/// one result is kept.
pub fn once<T>(lock: &OnceLock<T>, make: impl FnOnce() -> T) -> &T {
    match lock.get() {
        Some(made) => made,
        None => {
            let made = make();
            lock.get_or_init(|| made)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rayon::prelude::*;
    use std::sync::mpsc::channel;
    use std::time::Duration;

    #[test]
    fn threads_needing_the_value_during_its_computation_do_not_deadlock() {
        let (done, all) = channel();
        std::thread::spawn(move || {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(4).build().unwrap();
            let lock = OnceLock::new();
            let make = || -> usize {
                let part = |n: usize| {
                    std::thread::sleep(Duration::from_millis(1));
                    n
                };
                (0..64).into_par_iter().map(part).sum()
            };
            let asked = || (0..64).into_par_iter().map(|_| *once(&lock, make)).max();
            done.send(pool.install(asked)).unwrap();
        });
        let made = all.recv_timeout(Duration::from_mins(1));
        assert_eq!(made, Ok(Some(63 * 64 / 2)), "deadlock");
    }
}
