//! Who may move the film, and when it must go to 0 V: rules of the page as a state machine without sockets and clocks.

use std::fmt;
use std::str::FromStr;
use std::time::Duration;

use serde::{Deserialize, Serialize};

/// How old the newest state that the page in control has drawn may become while the film is enabled.
pub const PATIENCE: Duration = Duration::from_millis(1500);
/// A longer pause of the tool itself, or jump of the computer's clock: it slept, or was held up.
pub const PAUSE: Duration = Duration::from_secs(1);

/// A number that cannot be guessed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Deserialize, Serialize)]
#[serde(try_from = "String", into = "String")]
pub struct Token(u128);

impl Token {
    /// Another one every time, of the system's random numbers.
    ///
    /// # Panics
    ///
    /// Where the system has none.
    pub fn random() -> Self {
        let mut bytes = [0; 16];
        getrandom::fill(&mut bytes).expect("the system has random numbers");
        Self(u128::from_ne_bytes(bytes))
    }
}

impl fmt::Display for Token {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:032x}", self.0)
    }
}

impl FromStr for Token {
    type Err = &'static str;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let is_digit = |c: char| c.is_ascii_digit() || ('a'..='f').contains(&c);
        if text.len() != 32 || !text.chars().all(is_digit) {
            return Err("a token has 32 hexadecimal digits");
        }
        u128::from_str_radix(text, 16).map(Self).map_err(|_| "not a token")
    }
}

impl TryFrom<String> for Token {
    type Error = &'static str;

    fn try_from(text: String) -> Result<Self, Self::Error> {
        text.parse()
    }
}

impl From<Token> for String {
    fn from(token: Token) -> Self {
        token.to_string()
    }
}

/// A time by both clocks of the computer, from the start of the tool on.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Moment {
    /// By the clock that may stop while the computer sleeps.
    pub awake: Duration,
    /// By the clock on the wall.
    pub wall: Duration,
}

/// Reason to go to 0 V without a request.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Ended {
    /// The page in control has drawn nothing new: hidden, closed, killed, or its connection is gone.
    #[error("the page in control was not seen any more (hidden, closed, or disconnected)")]
    Unseen,
    /// The computer slept, or this tool was held up.
    #[error("this computer slept, or was held up")]
    Paused,
}

/// Why a request is not obeyed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Denied {
    /// Another page is in control, or none.
    #[error("this page is not in control: take control first, while the film is disarmed")]
    Control,
    /// The request was sent before, or is overtaken by a later one.
    #[error("the request came twice or too late")]
    Repeated,
    /// The request belongs to an arming that has ended.
    #[error("that arming has ended: arm again")]
    Arming,
    /// The page does not show what happens.
    #[error("the page does not show the present state: is its window in sight?")]
    Unseen,
    /// The film is enabled.
    #[error("not while the film is armed: stop it first")]
    Live,
}

/// Permission to do one thing: void once anything was stopped, or another page is in control.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[must_use]
pub struct Permit {
    page: Token,
    stops: u64,
}

#[derive(Clone, Copy, Debug)]
struct Page {
    token: Token,
    /// Its place among the pages that were in control, from 1.
    place: u32,
    /// The newest number of its requests.
    number: u64,
    /// Time of the newest state that it has drawn.
    drawn: Duration,
}

/// The page in control, its arming, and how often anything was stopped.
#[derive(Debug, Default)]
pub struct Control {
    page: Option<Page>,
    places: u32,
    arming: Option<Token>,
    stops: u64,
    last: Option<Moment>,
}

impl Control {
    /// Gives control to a page that is known by the token `page` from now on, and returns its place.
    ///
    /// # Errors
    ///
    /// [`Denied::Live`] while the film is enabled: its own page stops it first.
    pub fn take(&mut self, page: Token, now: Moment) -> Result<u32, Denied> {
        if self.arming.is_some() {
            return Err(Denied::Live);
        }
        self.places += 1;
        self.page = Some(Page { token: page, place: self.places, number: 0, drawn: now.awake });
        Ok(self.places)
    }

    /// Place of the page in control; 0 for none.
    pub fn place(&self) -> u32 {
        self.page.map_or(0, |page| page.place)
    }

    /// Whether a page has armed.
    pub fn is_armed(&self) -> bool {
        self.arming.is_some()
    }

    /// `page` has drawn the state of the time `drawn`. A time that has not come yet is no sign of life.
    pub fn drew(&mut self, page: Token, drawn: Duration, now: Moment) -> Result<(), Denied> {
        match &mut self.page {
            Some(own) if own.token == page && drawn <= now.awake => {
                own.drawn = own.drawn.max(drawn);
                Ok(())
            }
            _ => Err(Denied::Control),
        }
    }

    /// Permits `page` to do something now, by its request of this `number`; with an `arming`, only within that one, and without one only while
    /// the film is disarmed.
    ///
    /// # Errors
    ///
    /// [`Denied`], for the first rule that is broken.
    pub fn may(&mut self, page: Token, number: u64, arming: Option<Token>, now: Moment) -> Result<Permit, Denied> {
        let own = self.page.as_mut().filter(|own| own.token == page).ok_or(Denied::Control)?;
        if number <= own.number {
            return Err(Denied::Repeated);
        }
        own.number = number;
        if now.awake.saturating_sub(own.drawn) > PATIENCE {
            return Err(Denied::Unseen);
        }
        match (arming, self.arming) {
            (None, Some(_)) => Err(Denied::Live),
            (Some(_), _) if arming != self.arming => Err(Denied::Arming),
            _ => Ok(Permit { page, stops: self.stops }),
        }
    }

    /// Whether `permit` is still valid, now that its turn has come.
    pub fn is_valid(&self, permit: Permit) -> bool {
        permit.stops == self.stops && self.page.is_some_and(|page| page.token == permit.page)
    }

    /// The page of `permit` is about to arm, which is known as `arming` until it ends.
    ///
    /// # Errors
    ///
    /// [`Denied::Arming`] where something was stopped since, [`Denied::Live`] where it is armed.
    pub fn arm(&mut self, permit: Permit, arming: Token) -> Result<(), Denied> {
        if !self.is_valid(permit) {
            return Err(Denied::Arming);
        }
        if self.arming.is_some() {
            return Err(Denied::Live);
        }
        self.arming = Some(arming);
        Ok(())
    }

    /// An arming has ended, or is to end: everything that was permitted before is void.
    pub fn end(&mut self) {
        self.stops += 1;
        self.arming = None;
    }

    /// Looks at both clocks, at least every [`PAUSE`]; returns why the film must go to 0 V, if it must.
    pub fn look(&mut self, now: Moment) -> Option<Ended> {
        let before = self.last.replace(now).unwrap_or(now);
        let paused = now.awake.saturating_sub(before.awake);
        let jumped = now.wall.saturating_sub(before.wall).saturating_sub(paused);
        self.arming?;
        if paused > PAUSE || jumped > PAUSE {
            return Some(Ended::Paused);
        }
        let drawn = self.page.map_or(Duration::ZERO, |page| page.drawn);
        (now.awake.saturating_sub(drawn) > PATIENCE).then_some(Ended::Unseen)
    }
}
