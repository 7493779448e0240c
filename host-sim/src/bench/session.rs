//! A session with a board: one thread talks to it, another watches over the page in control.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex, MutexGuard};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant, SystemTime};

use tokio::sync::{oneshot, watch};

use super::board::Board;
use super::control::{Control, Moment, Permit};
use super::shared::{Live, Order, PUBLISH, Place, Shared, Wish, locked};

/// How often the clocks are looked at, and how soon a lost board is looked for again.
const LOOK: Duration = Duration::from_millis(50);
const AGAIN: Duration = Duration::from_secs(1);

/// A session with a board, for any number of pages. It ends, at 0 V, with this value.
pub struct Session {
    shared: Arc<Shared>,
    orders: Mutex<Sender<Order>>,
    threads: Mutex<Vec<JoinHandle<()>>>,
}

impl Session {
    /// Begins a session; a board that does not answer is looked for every second.
    pub fn begin(place: Place) -> Self {
        let (orders, waiting) = channel();
        let live = Live { port: place.port.clone(), state: "disconnected".into(), ..Live::default() };
        let shared = Arc::new(Shared {
            started: (Instant::now(), SystemTime::now()),
            control: Mutex::default(),
            stop: AtomicBool::new(false),
            why: Mutex::default(),
            stopper: Mutex::new(None),
            live: watch::Sender::new(live.clone()),
            over: AtomicBool::new(false),
        });
        let (owner, watcher) = (Arc::clone(&shared), Arc::clone(&shared));
        let own = thread::spawn(move || own(&owner, &place, &waiting, live));
        let watch = thread::spawn(move || {
            while !watcher.over.load(Ordering::Relaxed) {
                let ended = locked(&watcher.control).look(watcher.now());
                if let Some(ended) = ended {
                    watcher.stop(&ended.to_string());
                }
                watcher.renew();
                thread::sleep(LOOK);
            }
        });
        Self { shared, orders: Mutex::new(orders), threads: Mutex::new(vec![own, watch]) }
    }

    /// The states as they come.
    pub fn live(&self) -> watch::Receiver<Live> {
        self.shared.live.subscribe()
    }

    /// Time since its start, by both clocks.
    pub fn now(&self) -> Moment {
        self.shared.now()
    }

    /// The rules.
    pub fn control(&self) -> MutexGuard<'_, Control> {
        locked(&self.shared.control)
    }

    /// Brings the film to 0 V and disarms; anyone may ask for it.
    pub fn stop(&self, why: &str) {
        self.shared.stop(why);
    }

    /// Ends it: 0 V, disarmed, the recording closed.
    pub fn end(&self) {
        self.shared.stop("springpot has ended");
        self.shared.over.store(true, Ordering::SeqCst);
        for thread in locked(&self.threads).drain(..) {
            // A panic there has shown itself.
            let _ = thread.join();
        }
    }

    /// Has a wish done that was permitted; the receiver gets the outcome.
    pub fn ask(&self, wish: Wish, permit: Permit) -> oneshot::Receiver<std::result::Result<(), String>> {
        let (reply, outcome) = oneshot::channel();
        // Without the other thread the reply is dropped, which its receiver sees.
        let _ = locked(&self.orders).send(Order { wish, permit, reply });
        outcome
    }
}

impl Drop for Session {
    fn drop(&mut self) {
        self.end();
    }
}

/// Talks to the board, and looks for it again whenever it is lost.
fn own(shared: &Shared, place: &Place, orders: &Receiver<Order>, mut live: Live) {
    while !shared.over.load(Ordering::SeqCst) {
        let ended = match Board::new(shared, place, live.clone()) {
            Ok(mut board) => {
                let ended = board.talk(orders);
                let kept = board.log.take().map_or(Ok(()), |log| log.end(true));
                live = board.live;
                ended.and(kept)
            }
            Err(error) => Err(error),
        };
        *locked(&shared.stopper) = None;
        locked(&shared.control).end();
        let Err(error) = ended else { return };
        live = Live { port: live.port, state: "disconnected".into(), message: error.to_string(), ..Live::default() };
        let lost = Instant::now();
        while lost.elapsed() < AGAIN && !shared.over.load(Ordering::SeqCst) {
            shared.publish(&mut live);
            orders
                .try_iter()
                .for_each(|order| drop(order.reply.send(Err("there is no connection to the board".into()))));
            thread::sleep(PUBLISH);
        }
    }
}
