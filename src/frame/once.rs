//! A value that is computed when it is first asked for, on all cores.

use std::sync::OnceLock;

/// What `lock` holds, made by `make` where it is empty.
///
/// Not by `get_or_init`: while a thread waits for what other threads do for `make`, rayon gives it
/// other work, which may ask for the same value and would wait for that very thread. Here it is
/// made twice then, and one of the two is kept.
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
    fn threads_that_ask_while_it_is_made_on_all_of_them_do_not_wait_for_each_other() {
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
        assert_eq!(made, Ok(Some(63 * 64 / 2)), "they wait for each other");
    }
}
