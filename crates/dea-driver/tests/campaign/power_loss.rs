//! The store of parameters while the power fails in the middle of an erase or of a write, again and again.
//!
//! Explored: sequences of up to ten events on a simulated NOR flash ([`TornFlash`]): saves with the power on or cut in a random
//! operation (torn erases, torn words, unstable bits), restarts, bits that flip. From flash as it comes from the factory, with
//! something else in it, with sets that earlier versions of this crate wrote, and with sequence numbers before their wrap.
//!
//! Pass: never silently older. After every restart, twice in a row since bits may be unstable, [`Store::load`] gives the newest set
//! that is known to be stored (its save returned, or an earlier start has found it without a warning), or one whose save was cut off
//! after that, or an older one or none with the loss reported. Every set that is loaded is one that was saved, to the bit, and a save with
//! the power on succeeds. Factory flash never reports a loss.
//!
//! Cases: 300 seeds in the sample, 10 000 in full.

use dea_driver::{Blob, Parameters, Store, StoreError};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

use crate::bench::{board_parameters, encoded};
use crate::board::{SECTOR, slot};
use crate::scale::cases;
use crate::torn_flash::TornFlash;

const BOARD: u16 = 0x0405;
/// Sets that differ by their names, which are their numbers.
const SETS: usize = 24;

/// Operations of a save at the ends of its erases and headers.
const EDGES: [u64; 14] = [0, 1, 2, 193, 194, 195, 196, 197, 198, 199, 391, 392, 393, 394];

#[derive(Debug, Default)]
struct Counts {
    saves: u64,
    cuts: u64,
    starts: u64,
    /// The newest set known to be stored.
    newest: u64,
    /// One whose save was cut off.
    unreported: u64,
    older_reported: u64,
    none_reported: u64,
}

fn sets() -> Vec<Vec<u8>> {
    let named = |name: String| Parameters { name: name.as_str().try_into().expect("short"), ..board_parameters() };
    (0..SETS).map(|number| encoded(&named(number.to_string()), BOARD)).collect()
}

/// Initial contents of the flash, and the newest set in it.
fn contents(sets: &[Vec<u8>], random: &mut Pcg64) -> (Vec<u8>, Option<usize>) {
    let blank = vec![0xff; SECTOR];
    let two = |first: u32, second: u32| [slot(first, &sets[0]), slot(second, &sets[1])].concat();
    match random.random_range(0..8) {
        0 | 1 => ([blank.clone(), blank].concat(), None),
        2 => ((0..2 * SECTOR).map(|_| random.random()).collect(), None),
        // Earlier versions wrote the first set to the first slot alone.
        3 | 4 => ([slot(1, &sets[1]), blank].concat(), Some(1)),
        5 => (two(1, 2), Some(1)),
        6 => (two(u32::MAX - 1, u32::MAX), Some(1)),
        _ => {
            let first = u32::MAX - random.random_range(0..4);
            let second = first.wrapping_add(1);
            (two(first, if second == 0 { 1 } else { second }), Some(1))
        }
    }
}

struct History<'a> {
    sets: &'a [Vec<u8>],
    store: Store<TornFlash>,
    /// The newest set that is known to be stored.
    newest: Option<usize>,
    next: usize,
    /// Whether anything but factory flash was ever there.
    touched: bool,
}

impl History<'_> {
    fn with_flash(self, work: impl FnOnce(&mut TornFlash)) -> Self {
        let mut flash = self.store.destroy();
        work(&mut flash);
        Self { store: Store::new(flash, BOARD).expect("two parts"), ..self }
    }

    fn save(mut self, cut_after: Option<u64>, counts: &mut Counts) -> Self {
        let number = self.next;
        self.next += 1;
        self.touched = true;
        counts.saves += 1;
        if let Some(operations) = cut_after {
            self = self.with_flash(|flash| flash.fail_after(operations));
        }
        let saved = self.store.save(&self.sets[number]);
        if saved.is_ok() {
            self.newest = Some(number);
        }
        let error = saved.err();
        self.with_flash(|flash| {
            if flash.has_power() {
                assert_eq!(error, None, "the power is on");
            } else {
                counts.cuts += 1;
            }
            flash.restart();
        })
    }

    fn flip(mut self, part: usize, bit: usize) -> Self {
        self.touched = true;
        self.with_flash(|flash| flash.flip(part, bit))
    }

    fn start(&mut self, counts: &mut Counts) {
        counts.starts += 1;
        match self.store.load() {
            Ok(stored) => {
                let number = self.number(&stored.blob);
                match self.newest {
                    Some(newest) if number < newest => {
                        assert!(stored.newer_lost, "set {number} instead of {newest}, silently");
                        counts.older_reported += 1;
                    }
                    Some(newest) if number == newest => {
                        counts.newest += 1;
                    }
                    _ => counts.unreported += 1,
                }
                if !stored.newer_lost {
                    self.newest = Some(number);
                }
            }
            Err(StoreError::Empty(fault)) => {
                assert!(fault.is_some() || self.newest.is_none(), "set {:?} is lost, silently", self.newest);
                assert!(fault.is_none() || self.touched, "{fault:?} in factory flash");
                counts.none_reported += u64::from(self.newest.is_some());
            }
            Err(error) => panic!("{error:?}"),
        }
    }

    /// The number of a set, which must be as it was saved.
    fn number(&self, blob: &Blob) -> usize {
        let number: usize = blob.parameters().name.parse().expect("a number");
        assert_eq!(encoded(blob.parameters(), BOARD), self.sets[number], "set {number} is damaged");
        number
    }
}

fn run(seed: u64, sets: &[Vec<u8>], counts: &mut Counts) {
    let mut random = Pcg64::seed_from_u64(seed);
    let (bytes, newest) = contents(sets, &mut random);
    let touched = bytes.iter().any(|&byte| byte != 0xff);
    let store = Store::new(TornFlash::new(&bytes, random.random()), BOARD).expect("two parts");
    let mut history = History { sets, store, newest, next: 2, touched };
    history.start(counts);
    let flips = random.random_bool(0.5);
    for _ in 0..random.random_range(2..=10) {
        history = match random.random_range(0..10) {
            0..=2 => history.save(None, counts),
            // A save takes 196 operations, or twice as many. Many cuts close to the ends of erases and headers.
            3..=4 => history.save(Some(random.random_range(0..400)), counts),
            5..=7 => history.save(Some(EDGES[random.random_range(0..EDGES.len())]), counts),
            _ if flips => {
                let bits = if random.random_bool(0.3) { 64 } else { 8 * 700 };
                history.flip(random.random_range(0..2), random.random_range(0..bits))
            }
            _ => history.save(Some(random.random_range(0..2)), counts),
        };
        history.start(counts);
        history.start(counts);
    }
}

#[test]
fn never_silently_older() {
    let sets = sets();
    let seeds = cases(300, 10_000);
    let mut counts = Counts::default();
    for seed in 0..seeds {
        run(seed, &sets, &mut counts);
    }
    println!("power_loss: {seeds} seeds, {counts:?}");
    let Counts { cuts, older_reported, unreported, .. } = counts;
    assert!(cuts > seeds && older_reported > seeds / 10 && unreported > seeds / 100);
}

/// The newest set is damaged, in its header or its blob, and the save that would replace it is cut off in any operation: with flash of this
/// version, and of earlier ones, which wrote the first set to one slot alone.
#[test]
fn a_save_over_a_damaged_set_that_is_cut_off_is_reported() {
    let (sets, mut counts) = (sets(), Counts::default());
    let this = [slot(4, &sets[1]), slot(3, &sets[0])].concat();
    let earlier = [slot(1, &sets[0]), slot(2, &sets[1])].concat();
    for (damaged, bytes) in [(0, this), (1, earlier)] {
        let cuts = [0, 40, 800, 2400].into_iter().flat_map(|bit| EDGES.map(|operations| (bit, operations)));
        for ((bit, operations), seed) in cuts.flat_map(|cut| (0..20).map(move |seed| (cut, seed))) {
            let store = Store::new(TornFlash::new(&bytes, seed), BOARD).expect("two parts");
            let history = History { sets: &sets, store, newest: Some(1), next: 2, touched: true };
            let mut history = history.flip(damaged, bit).save(Some(operations), &mut counts);
            history.start(&mut counts);
            history.start(&mut counts);
        }
    }
    assert!(counts.cuts > 1000 && counts.older_reported > 100, "{counts:?}");
}
