//! The rules of the page, without sockets, boards or clocks.

use std::time::Duration;

use host_sim::bench::control::{Control, Denied, Ended, Moment, PATIENCE, PAUSE, Token};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

fn at(ms: u64) -> Moment {
    Moment { awake: Duration::from_millis(ms), wall: Duration::from_millis(ms) }
}

/// Control, and a page that has armed at 0 s.
fn armed() -> (Control, Token, Token) {
    let (mut control, page, arming) = (Control::default(), Token::random(), Token::random());
    control.take(page, at(0)).expect("no page is in control");
    let permit = control.may(page, 1, None, at(0)).expect("permitted");
    control.arm(permit, arming).expect("armed");
    assert_eq!(control.look(at(0)), None);
    (control, page, arming)
}

/// Looks at both clocks every 50 ms, while the page draws until `drawn_ms`; returns when and why it ended.
fn ends(control: &mut Control, page: Token, drawn_ms: u64) -> Option<(u64, Ended)> {
    (50..10_000).step_by(50).find_map(|ms| {
        if ms <= drawn_ms {
            control.drew(page, at(ms).awake, at(ms)).expect("in control");
        }
        control.look(at(ms)).map(|ended| (ms, ended))
    })
}

#[test]
fn a_page_that_is_not_seen_ends_its_arming() {
    let patience_ms = u64::try_from(PATIENCE.as_millis()).expect("some ms");
    for drawn_ms in [0, 1000, 5000] {
        let (mut control, page, _) = armed();
        let (ms, why) = ends(&mut control, page, drawn_ms).expect("it ends");
        assert_eq!(why, Ended::Unseen);
        assert!((drawn_ms + patience_ms..=drawn_ms + patience_ms + 100).contains(&ms), "{ms} ms");
    }
    let (mut control, page, _) = armed();
    assert_eq!(ends(&mut control, page, u64::MAX), None);
    // A time that has not come yet, an old one, and another page's are no signs of life.
    let (mut control, page, _) = armed();
    assert_eq!(control.drew(page, at(5000).awake, at(100)), Err(Denied::Control));
    assert_eq!(control.drew(Token::random(), at(100).awake, at(100)), Err(Denied::Control));
    (100..1500).step_by(100).for_each(|ms| control.drew(page, at(0).awake, at(ms)).expect("in control"));
    assert_eq!(ends(&mut control, page, 0).map(|(_, why)| why), Some(Ended::Unseen));
}

/// While the computer sleeps one clock stops and the other goes on; or both go on, and this program does not.
#[test]
fn a_computer_that_slept_ends_an_arming() {
    for (awake, wall) in [(50, 3_600_000), (3_600_000, 3_600_000)] {
        let (mut control, page, _) = armed();
        let woken = Moment { awake: Duration::from_millis(awake), wall: Duration::from_millis(wall) };
        control.drew(page, woken.awake, woken).expect("in control");
        assert_eq!(control.look(woken), Some(Ended::Paused));
    }
    // Within the pause, and a clock that is set back, nothing has happened.
    for wall in [u64::try_from(PAUSE.as_millis()).expect("some ms"), 0] {
        let (mut control, _, _) = armed();
        assert_eq!(control.look(Moment { awake: Duration::from_millis(50), wall: Duration::from_millis(wall) }), None);
    }
}

/// One page at a time; another one gets control while the film is disarmed, and nothing that the first was permitted is done then.
#[test]
fn two_pages_share_nothing() {
    let (mut control, first, arming) = armed();
    let second = Token::random();
    assert_eq!(control.take(second, at(10)), Err(Denied::Live));
    assert_eq!(control.may(second, 1, Some(arming), at(10)).err(), Some(Denied::Control));
    let permit = control.may(first, 2, Some(arming), at(10)).expect("permitted");
    assert!(control.is_valid(permit));
    control.end();
    assert!(!control.is_valid(permit) && control.arm(permit, arming).is_err());
    assert_eq!(control.take(second, at(20)), Ok(2));
    assert_eq!(control.may(first, 3, None, at(20)).err(), Some(Denied::Control));
    assert!(control.may(second, 1, None, at(20)).is_ok());
}

/// Random sequences against the rules in their plainest form: what is permitted has the newest number of the page in control, which was seen, and
/// an arming where one is needed; what was permitted before anything ended is never valid again.
#[test]
fn what_is_permitted_is_of_a_page_in_sight_and_of_this_arming() {
    let (mut permitted, mut stopped) = (0, 0);
    for seed in 0..200 {
        let mut random = Pcg64::seed_from_u64(seed);
        let pages: Vec<Token> = (0..3).map(|_| Token::random()).collect();
        let armings: Vec<Token> = (0..3).map(|_| Token::random()).collect();
        let mut control = Control::default();
        let (mut holder, mut armed, mut drawn_ms, mut newest, mut now_ms) = (None, None, 0, 0, 0_u64);
        let mut permits = Vec::new();
        for _ in 0..500 {
            now_ms += random.random_range(0..400);
            let (page, now) = (pages[random.random_range(0..3)], at(now_ms));
            match random.random_range(0..6) {
                0 => {
                    let taken = control.take(page, now).is_ok();
                    assert_eq!(taken, armed.is_none());
                    if taken {
                        (holder, drawn_ms, newest) = (Some(page), now_ms, 0);
                        permits.clear();
                    }
                }
                1 => {
                    let ms = now_ms.saturating_sub(random.random_range(0..2000));
                    let drew = control.drew(page, at(ms).awake, now).is_ok();
                    assert_eq!(drew, holder == Some(page));
                    drawn_ms = if drew { drawn_ms.max(ms) } else { drawn_ms };
                }
                2 => {
                    let number = random.random_range(0..50);
                    let arming = random.random_bool(0.5).then(|| armings[random.random_range(0..3)]);
                    let may = control.may(page, number, arming, now);
                    let is_new = holder == Some(page) && number > newest;
                    let is_seen = now.awake - at(drawn_ms).awake <= PATIENCE;
                    assert_eq!(may.is_ok(), is_new && is_seen && arming == armed, "{may:?}");
                    newest = if is_new { number } else { newest };
                    permits.extend(may.ok().map(|permit| (permit, arming)));
                    permitted += usize::from(may.is_ok());
                }
                3 => {
                    if let Some((permit, _)) = permits.iter().find(|(_, arming)| arming.is_none()) {
                        let token = armings[random.random_range(0..3)];
                        let done = control.arm(*permit, token).is_ok();
                        assert_eq!(done, armed.is_none());
                        armed = armed.or(done.then_some(token));
                    }
                }
                4 if random.random_bool(0.2) => {
                    control.end();
                    armed = None;
                    assert!(permits.drain(..).all(|(permit, _)| !control.is_valid(permit)));
                    stopped += 1;
                }
                _ => assert!(permits.iter().all(|(permit, _)| control.is_valid(*permit))),
            }
            assert_eq!(control.is_armed(), armed.is_some());
        }
    }
    assert!(permitted > 500 && stopped > 500, "{permitted}, {stopped}");
}
