//! The tasks of every image: the control tick, the bytes of the link, and the background.

#[rtic::app(device = crate::family::pac, peripherals = false)]
mod tasks {
    use cortex_m::peripheral::SCB;
    use dea_driver::chips::Converters;
    use dea_driver::server::{FlightRecorder, Session, StartError};
    use dea_driver::wire::{FRAME_LEN, Message, encode};
    use dea_driver::{Cause, Device, Drive, DriverState, Store, StoreError};
    use heapless::spsc::{Consumer, Producer, Queue};

    use crate::background::{self, Background, FlightMemory, Ticker};
    use crate::bench::{AdcBus, Bench};
    use crate::board::{self, DARK};
    use crate::clock::{self, Captures, Clocks, Watch};
    use crate::family::flash::ParameterFlash;
    use crate::family::pac::Interrupt;
    use crate::family::serial::{self, Port};
    use crate::family::{self, Chip, reset};
    use crate::machine;
    use crate::panic::Message as PanicMessage;
    use crate::pin::Pin;
    use crate::watchdog::{self, Watchdog};

    /// Converters of the board, with those of its bench.
    #[cfg(not(feature = "self-sensing"))]
    const CONVERTERS: Converters = board::CONVERTERS;
    #[cfg(feature = "self-sensing")]
    const CONVERTERS: Converters = Converters { current_v: Some(crate::bench::CURRENT_V), ..board::CONVERTERS };

    /// Until there are parameters.
    const RATE_HZ: f32 = 1000.0;
    /// Bytes that wait for the background: 11 ms at that rate.
    const RECEIVED: usize = 512;
    /// Bytes that wait to be sent: the longest answer and two records.
    const SENDING: usize = 512;

    #[shared]
    struct Shared {
        device: Device,
        watchdog: Watchdog,
        recorder: FlightRecorder<FlightMemory>,
    }

    #[local]
    struct Local {
        bench: Bench,
        led: Pin,
        captures: Captures,
        watch: Watch,
        serial: Port,
        rx: Producer<'static, u8>,
        received: Consumer<'static, u8>,
        sending: Producer<'static, u8>,
        tx: Consumer<'static, u8>,
        store: Store<ParameterFlash>,
        ticker: Ticker,
        panic_message: PanicMessage,
    }

    #[init(local = [
        adc_bus: Option<AdcBus> = None,
        incoming: Queue<u8, RECEIVED> = Queue::new(),
        outgoing: Queue<u8, SENDING> = Queue::new(),
    ])]
    fn init(cx: init::Context) -> (Shared, Local) {
        machine::start();
        let chip = Chip::take();
        let panic_message = PanicMessage::take();
        let mut latched = reset::cause(&chip.rcc, &panic_message);
        let avoid = panic_message.as_str().starts_with(clock::PANIC);
        let rcc = family::constrain(chip.rcc);
        let Clocks { mut rcc, fault, captures, watch } = clock::start(rcc, chip.timer, board::CRYSTAL_HZ, avoid);

        // The amplifier's enable output is low before anything else is set up.
        let (led, link, pins) = board::start(chip.parts, &mut rcc);

        let core_hz = machine::core_hz(&rcc);
        defmt::info!("firmware {}, core at {} Hz", env!("CARGO_PKG_VERSION"), core_hz);
        latched = latched.or(fault.and_then(machine::report));

        let bench = Bench::new(pins, cx.local.adc_bus, &mut rcc);

        let Ok(serial) = serial::open(chip.usart, link, &mut rcc) else { panic!("the clock is too slow for the link") };
        let (rx, received) = cx.local.incoming.split();
        let (sending, tx) = cx.local.outgoing.split();

        latched = latched.or(reset::check_option_bytes(&chip.flash));
        let Ok(store) = Store::with_converters(ParameterFlash::new(chip.flash), board::ID, CONVERTERS) else {
            panic!("the flash holds two slots")
        };
        let mut watchdog = Watchdog::take();
        watchdog::outlive_debugger();
        background::watch(&mut watchdog);
        let ticker = Ticker::start(cx.core.SYST, core_hz, RATE_HZ);
        let shared = Shared { device: Device::new(latched), watchdog, recorder: background::flight_recorder() };
        (shared, Local { bench, led, captures, watch, serial, rx, received, sending, tx, store, ticker, panic_message })
    }

    /// The control tick.
    #[task(binds = SysTick, priority = 2, local = [bench, led, watch, micros: u32 = 0], shared = [device, watchdog, recorder])]
    fn tick(mut cx: tick::Context) {
        let tick::LocalResources { bench, led, watch, micros, .. } = cx.local;
        machine::begin_tick();
        watchdog::outlive_debugger();
        let (state, is_served, rate_hz, record) = cx.shared.device.lock(|device| {
            bench.prepare(device.controller());
            let inputs = bench.sample();
            #[cfg(feature = "self-sensing")]
            device.note_current(bench.current_adc_v(device.rate_hz()));
            let drive = device.tick(inputs);
            if bench.apply(drive).is_err() {
                device.trip(Cause::Bus);
            }
            // The next tick is due already: this one was too slow.
            if SCB::is_pendst_pending() {
                device.trip(Cause::Overrun);
                // The cause is latched, whatever the outcome.
                let _ = bench.apply(Drive { range: drive.range, ..Drive::OFF });
            }
            device.report(bench.inspection());
            if let Some(cause) = watch.check(device.rate_hz(), machine::report) {
                device.latch(cause);
            }
            let is_served = device.background_is_alive() && !background::is_watchdog_expiring();
            (device.state(), is_served, device.rate_hz(), device.flight_record())
        });
        if let Some(record) = record {
            cx.shared.recorder.lock(|recorder| recorder.push(&record, rate_hz));
        }

        // Lit while the amplifier is enabled; with short gaps while the film is live although it is disabled; blinking slowly when
        // disarmed, fast when tripped.
        *micros = micros.wrapping_add((1e6 / rate_hz) as u32);
        let dark = match state {
            DriverState::Armed | DriverState::Running => false,
            DriverState::Disarmed => *micros & 1 << 19 == 0,
            DriverState::Tripped(Cause::LiveFilm) => *micros & 0xf << 15 == 0,
            DriverState::Tripped(_) => *micros & 1 << 16 == 0,
        };
        led.set(dark == DARK);
        // Last, and only if the background still serves the host.
        if is_served {
            cx.shared.watchdog.lock(Watchdog::feed);
        }
    }

    /// Captures edges of the slow oscillator for the tick, which compares the clocks.
    #[task(binds = TIM5, priority = 1, local = [captures])]
    fn slow_oscillator(cx: slow_oscillator::Context) {
        cx.local.captures.take();
    }

    /// Bytes of the link, in and out.
    #[task(binds = USART2, priority = 3, local = [serial, rx, tx])]
    fn link(cx: link::Context) {
        let link::LocalResources { serial, rx, tx, .. } = cx.local;
        if let Some(byte) = machine::received(serial)
            && rx.enqueue(byte).is_err()
        {
            background::lose_byte();
        }
        serial::send(serial, || tx.dequeue());
    }

    /// Requests and telemetry, in the time that is left.
    #[idle(local = [received, sending, store, ticker, panic_message], shared = [device, watchdog, recorder])]
    fn idle(cx: idle::Context) -> ! {
        let idle::LocalResources { received, sending, store, ticker, panic_message, .. } = cx.local;
        let idle::SharedResources { device, watchdog, recorder, .. } = cx.shared;
        let mut board =
            Background { device, watchdog, store, ticker, panic_message, recorder, program: background::program() };
        let mut session = Session::new(env!("CARGO_PKG_VERSION"));
        match session.begin(&mut board) {
            Ok(()) => defmt::info!("runs the parameters that it keeps"),
            Err(StartError::Store(StoreError::Empty(found))) if machine::is_erased(found) => {
                defmt::info!("waits for parameters");
            }
            Err(error) => defmt::error!("waits for parameters; those it keeps: {}", error),
        }
        loop {
            let bytes = core::iter::from_fn(|| received.dequeue());
            let mut quiet = !session.turn(bytes, &mut board, |message| send(message, sending));
            // A record waits in the device until there is room, so that dropped records are counted.
            while sending.capacity() - sending.len() > FRAME_LEN
                && let Some(record) = board.device.lock(Device::telemetry)
            {
                quiet = false;
                send(&Message::Telemetry(record), sending);
            }
            if quiet {
                // An interrupt that comes after the question still ends the wait.
                cortex_m::interrupt::free(|_| {
                    if !received.ready() {
                        cortex_m::asm::wfi();
                    }
                });
            }
        }
    }

    /// Sends a message, waiting for room.
    fn send(message: &Message, sending: &mut Producer<'static, u8>) {
        let mut frame = [0; FRAME_LEN + 1];
        // Every message fits, which a test of the link checks.
        let length = encode(message, &mut frame).unwrap_or(0);
        for &byte in &frame[..length] {
            while sending.enqueue(byte).is_err() {
                rtic::pend(Interrupt::USART2);
            }
        }
        rtic::pend(Interrupt::USART2);
    }
}
