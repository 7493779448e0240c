//! Creep compensation for a dielectric elastomer actuator on an STM32F405.
//!
//! Every tick, by SysTick, 1000 times a second unless the parameters say otherwise:
//!
//! 1. sample: interlock, voltage monitor, displacement sensor;
//! 2. check: sensors, limits, the host's heartbeat;
//! 3. estimate: where the model is under the voltage that stood;
//! 4. command: what the mode asks for, within the limits;
//! 5. log: every so-many-th tick, for the host.
//!
//! 2 to 5 are [`dea_driver::Controller::tick`]. Bytes of the link (USART2, 460 800 baud) come and go by interrupt, above the
//! tick, since the chip keeps only one; requests are answered in the background, below it. Whatever goes wrong ends with PC6
//! low, which disables the amplifier: a trip at once, a panic before it resets the chip, a hanging tick by the watchdog after
//! 50 ms, a hanging background by the same half a second later, a reset by the resistor at the pin.
#![no_std]
#![no_main]

#[cfg(all(feature = "rtt", feature = "semihosting"))]
compile_error!("one log at a time: --no-default-features --features rtt for a board");
#[cfg(not(any(feature = "rtt", feature = "semihosting")))]
compile_error!("the log needs a way out: --features rtt for a board, --features semihosting for QEMU");
#[cfg(all(feature = "virtual-bench", not(feature = "semihosting")))]
compile_error!(
    "the virtual bench drives no pins: it is for QEMU alone; leave --features virtual-bench out for a board"
);

#[cfg(feature = "rtt")]
use defmt_rtt as _;
#[cfg(feature = "semihosting")]
use defmt_semihosting as _;

#[cfg(all(feature = "semihosting", not(feature = "virtual-bench")))]
mod absent;
#[cfg(not(feature = "semihosting"))]
mod bench;
mod board;
mod clock;
#[cfg(feature = "semihosting")]
mod emulated;
#[cfg(feature = "virtual-bench")]
mod film;
mod flash;
mod outputs;
mod panic;
mod reset;
mod serial;
#[cfg(feature = "virtual-bench")]
mod virtual_bench;

#[rtic::app(device = stm32f4xx_hal::pac, peripherals = true)]
mod app {
    use cortex_m::peripheral::SCB;
    use dea_driver::server::{Session, StartError};
    use dea_driver::wire::{FRAME_LEN, Message, boards, encode};
    use dea_driver::{Cause, Device, Drive, DriverState, Store, StoreError};
    use heapless::spsc::{Consumer, Producer, Queue};
    use stm32f4xx_hal::gpio::{Output, PC12, PinState};
    use stm32f4xx_hal::hal_02::serial::Write;
    use stm32f4xx_hal::pac::{DBGMCU, Interrupt, USART2};
    use stm32f4xx_hal::prelude::*;
    use stm32f4xx_hal::serial::{Event, Serial};
    use stm32f4xx_hal::watchdog::IndependentWatchdog;

    #[cfg(all(feature = "semihosting", not(feature = "virtual-bench")))]
    use crate::absent::{AdcBus, Bench};
    #[cfg(not(feature = "semihosting"))]
    use crate::bench::{AdcBus, Bench, Pins};
    use crate::board::{self, Background, Ticker};
    use crate::clock;
    #[cfg(feature = "semihosting")]
    use crate::emulated;
    use crate::flash::ParameterFlash;
    use crate::outputs;
    use crate::panic::Message as PanicMessage;
    use crate::reset;
    use crate::serial;
    #[cfg(feature = "virtual-bench")]
    use crate::virtual_bench::{AdcBus, Bench};

    /// Until there are parameters.
    const RATE_HZ: f32 = 1000.0;
    /// Bytes that wait for the background: 11 ms at that rate.
    const RECEIVED: usize = 512;
    /// Bytes that wait for the wire: the longest answer and two samples.
    const SENDING: usize = 512;

    #[shared]
    struct Shared {
        device: Device,
        watchdog: IndependentWatchdog,
    }

    #[local]
    struct Local {
        bench: Bench,
        debug: DBGMCU,
        led: PC12<Output>,
        serial: Serial<USART2>,
        heard: Producer<'static, u8>,
        received: Consumer<'static, u8>,
        sending: Producer<'static, u8>,
        said: Consumer<'static, u8>,
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
        #[cfg(feature = "semihosting")]
        board::stop_on_a_chip();
        let chip = cx.device;
        let panic_message = PanicMessage::take();
        let latched = reset::cause(&chip.RCC, &panic_message);
        let (mut rcc, fault) = clock::start(chip.RCC, &chip.TIM5, panic_message.as_str().starts_with(clock::PANIC));

        // The amplifier's enable output is low before anything else is set up.
        let (enable, led, interlock) = outputs::start(chip.GPIOC, &mut rcc);

        // QEMU's core has one clock, whatever the registers say.
        let core_hz = if cfg!(feature = "semihosting") { clock::CORE_HZ } else { rcc.clocks.hclk().raw() };
        defmt::info!("firmware {}, core at {} Hz", env!("CARGO_PKG_VERSION"), core_hz);
        if let Some(fault) = fault {
            // QEMU has no crystal: there it is no fault.
            #[cfg(feature = "semihosting")]
            defmt::debug!("clock: {}", fault);
            #[cfg(not(feature = "semihosting"))]
            defmt::error!("clock: {}; the internal oscillator serves", fault);
        }

        let gpioa = chip.GPIOA.split(&mut rcc);
        #[cfg(not(feature = "semihosting"))]
        let bench = {
            let adc = (gpioa.pa5, gpioa.pa6, gpioa.pa7);
            let pins = Pins { enable, interlock, adc, port_b: chip.GPIOB.split(&mut rcc) };
            Bench::new(chip.SPI1, chip.SPI2, pins, cx.local.adc_bus, &mut rcc)
        };
        #[cfg(feature = "semihosting")]
        let bench = {
            let _: (&Option<AdcBus>, _, _) = (cx.local.adc_bus, enable, interlock);
            Bench::new()
        };

        let Ok(serial) = serial::open(chip.USART2, gpioa.pa2, gpioa.pa3, &mut rcc) else {
            panic!("the clock is too slow for the link")
        };
        let (heard, received) = cx.local.incoming.split();
        let (sending, said) = cx.local.outgoing.split();

        reset::warn_of_option_bytes(&chip.FLASH);
        let Ok(store) = Store::new(ParameterFlash::new(chip.FLASH), boards::STM32F405) else {
            panic!("two sectors hold two slots")
        };
        let mut watchdog = IndependentWatchdog::new(chip.IWDG);
        let debug = chip.DBGMCU;
        board::outlive_debugger(&debug);
        board::watch(&mut watchdog);
        let ticker = Ticker::start(cx.core.SYST, core_hz, RATE_HZ);
        let shared = Shared { device: Device::new(latched), watchdog };
        (shared, Local { bench, debug, led, serial, heard, received, sending, said, store, ticker, panic_message })
    }

    /// The control tick.
    #[task(binds = SysTick, priority = 2, local = [bench, debug, led, micros: u32 = 0], shared = [device, watchdog])]
    fn tick(mut cx: tick::Context) {
        let tick::LocalResources { bench, debug, led, micros, .. } = cx.local;
        #[cfg(feature = "semihosting")]
        emulated::begin_tick();
        board::outlive_debugger(debug);
        let (state, is_served, rate_hz) = cx.shared.device.lock(|device| {
            #[cfg(feature = "virtual-bench")]
            bench.mount(device.controller());
            let drive = device.tick(bench.sample());
            if bench.apply(drive).is_err() {
                device.trip(Cause::Bus);
            }
            // The next tick is due already: this one was too slow.
            if SCB::is_pendst_pending() {
                device.trip(Cause::Overrun);
                // Whatever comes of it, the cause is latched.
                let _ = bench.apply(Drive { range: drive.range, ..Drive::OFF });
            }
            device.report(bench.inspection());
            (device.state(), device.background_is_alive() && !board::is_starved(), device.rate_hz())
        });

        // Lit while the amplifier is enabled; lit with short gaps while the film is live although it is not; slow when disarmed,
        // fast when tripped, in the same time at every rate. The light hangs between supply and pin.
        *micros = micros.wrapping_add((1e6 / rate_hz) as u32);
        let dark = match state {
            DriverState::Armed | DriverState::Running => false,
            DriverState::Disarmed => *micros & 1 << 19 == 0,
            DriverState::Tripped(Cause::LiveFilm) => *micros & 0xf << 15 == 0,
            DriverState::Tripped(_) => *micros & 1 << 16 == 0,
        };
        led.set_state(PinState::from(dark));
        // Last, and only if the host is still heard.
        if is_served {
            cx.shared.watchdog.lock(IndependentWatchdog::feed);
        }
    }

    /// Bytes of the link, in and out.
    #[task(binds = USART2, priority = 3, local = [serial, heard, said])]
    fn link(cx: link::Context) {
        let link::LocalResources { serial, heard, said, .. } = cx.local;
        #[cfg(not(feature = "semihosting"))]
        let byte = serial::received(serial);
        #[cfg(feature = "semihosting")]
        let byte = emulated::received(serial);
        if let Some(byte) = byte {
            // One that finds no room is lost, and its frame with it: that is counted where frames are.
            let _ = heard.enqueue(byte);
        }
        if serial.is_tx_empty() {
            match said.dequeue() {
                Some(byte) => {
                    // It is empty, so there is no waiting.
                    let _ = Write::write(serial, byte);
                    serial.listen(Event::TxEmpty);
                }
                None => serial.unlisten(Event::TxEmpty),
            }
        }
    }

    /// Requests and telemetry, in the time that is left.
    #[idle(local = [received, sending, store, ticker, panic_message], shared = [device, watchdog])]
    fn idle(cx: idle::Context) -> ! {
        let idle::LocalResources { received, sending, store, ticker, panic_message, .. } = cx.local;
        let mut board =
            Background { device: cx.shared.device, watchdog: cx.shared.watchdog, store, ticker, panic_message };
        let mut session = Session::new(env!("CARGO_PKG_VERSION"));
        match session.begin(&mut board) {
            Ok(()) => defmt::info!("runs the parameters that it keeps"),
            Err(StartError::Store(StoreError::Empty(None))) => defmt::info!("waits for parameters"),
            // QEMU's flash reads 0 where nothing was loaded, which no erased flash does.
            #[cfg(feature = "semihosting")]
            Err(StartError::Store(StoreError::Empty(_))) => defmt::info!("waits for parameters"),
            Err(error) => defmt::error!("waits for parameters; those it keeps: {}", error),
        }
        loop {
            board.device.lock(Device::background_came_round);
            let mut quiet = true;
            while let Some(byte) = received.dequeue() {
                quiet = false;
                if let Some(message) = session.serve(byte, &mut board) {
                    send(&message, sending);
                }
            }
            // A sample waits where it is until there is room, so that what is dropped is counted.
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

    /// Hands a message to the wire, waiting for room.
    fn send(message: &Message, sending: &mut Producer<'static, u8>) {
        let mut frame = [0; FRAME_LEN + 1];
        // Every message fits: a test of the link holds that.
        let length = encode(message, &mut frame).unwrap_or(0);
        for &byte in &frame[..length] {
            while sending.enqueue(byte).is_err() {
                rtic::pend(Interrupt::USART2);
            }
        }
        rtic::pend(Interrupt::USART2);
    }
}
