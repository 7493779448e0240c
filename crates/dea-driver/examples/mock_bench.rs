//! The driver against mocks: an amplifier on an AD5754 and two ADS868x, every transaction stated. No hardware is needed.

use dea_driver::chips::{AdcRange, CommandRange, DacCode};
use dea_driver::{Ads868x, Amplifier, Blob, Cause, Controller, Device, DriverState, Inputs, Mode, Parameters};
use embedded_hal_mock::eh1::digital::{Mock as Pin, State as Level, Transaction as OnPin};
use embedded_hal_mock::eh1::spi::{Mock as Spi, Transaction as OnSpi};
use springpot::{Actuator, Law, LawOptions, Preset};

/// 24 bits to the AD5754: register and channel, then 16 bits of data.
fn written(register: u8, data: u16) -> [OnSpi<u8>; 3] {
    let [high, low] = data.to_be_bytes();
    [OnSpi::transaction_start(), OnSpi::write_vec(vec![register, high, low]), OnSpi::transaction_end()]
}

/// The same, while the AD5754 answers what the frame before asked for.
fn answered(register: u8, data: u16, answer: u16) -> [OnSpi<u8>; 3] {
    let [[high, low], [first, second]] = [data, answer].map(u16::to_be_bytes);
    let frame = OnSpi::transfer_in_place(vec![register, high, low], vec![0, first, second]);
    [OnSpi::transaction_start(), frame, OnSpi::transaction_end()]
}

/// A register that is read back.
fn read(register: u8, answer: u16) -> Vec<OnSpi<u8>> {
    [written(0x80 | register, 0), answered(0x18, 0, answer)].concat()
}

/// A new code, while the DAC returns the previous one.
fn commanded(code: u16, stood: u16) -> Vec<OnSpi<u8>> {
    [written(0x80, 0), answered(0x00, code, stood)].concat()
}

/// 32 bits to and from an ADS868x.
fn exchanged(sent: [u8; 4], answer: [u16; 2]) -> [OnSpi<u8>; 3] {
    let [[first, second], [third, fourth]] = answer.map(u16::to_be_bytes);
    let answer = vec![first, second, third, fourth];
    [OnSpi::transaction_start(), OnSpi::transfer_in_place(sent.to_vec(), answer), OnSpi::transaction_end()]
}

/// Ticks before the driver is armed: the ADCs are set up in four, and a sensor counts as plausible after ten good readings.
const DISARMED: usize = 15;

/// An ADC that is set up in four ticks and then answers one code in each, with its range beside it.
fn adc(codes: &[u16]) -> Ads868x<Spi<u8>> {
    let mut expected = Vec::new();
    expected.extend(exchanged([0xd0, 0x14, 0, 9], [0; 2])); // range 0 to 10.24 V
    expected.extend(exchanged([0xd0, 0x10, 1, 0], [0; 2])); // the range in every frame
    expected.extend(exchanged([0xc8, 0x14, 0, 0], [0; 2])); // read the range back
    expected.extend(exchanged([0; 4], [9, 0]));
    expected.extend(codes.iter().flat_map(|&code| exchanged([0; 4], [code, 0x9000])));
    Ads868x::new(Spi::new(&expected), AdcRange::UpTo10V24)
}

pub fn main() {
    let model = Preset::TABLE3_N2.model().expect("valid");
    let law: Law<f32> = Law::compressed(&model, LawOptions::at_step(1e-3)).expect("valid");
    let blob = Blob::new(Parameters::bench(&law, Actuator::KARNER_2022)).expect("valid");
    let mut device = Device::new(None);
    device.install(Controller::new(blob)).expect("the amplifier is disabled");

    // Thermal shutdown, range 0 to 10 V, register at 0 V, power.
    let start = [written(0x19, 0xc), written(0x08, 1), written(0x00, 0), written(0x10, 1)].concat();
    let off = [written(0x00, 0).to_vec(), read(0x10, 1)].concat();
    let commands = [50.0, 100.0].map(|volts| DacCode::from_volts(volts / 1000.0, CommandRange::TenVolts).0);
    let mut on_dac = start.clone();
    on_dac.extend(vec![off.clone(); DISARMED].concat());
    on_dac.extend(start); // armed: enabled at 0 V once protection, range, power and code read as they should
    on_dac.extend([read(0x19, 0xc), read(0x08, 1), read(0x10, 1), read(0x00, 0)].concat());
    on_dac.extend(commanded(0, 0));
    on_dac.extend(commanded(commands[0], 0)); // running, two ticks: 50 kV/s
    on_dac.extend(commanded(commands[1], commands[0]));
    on_dac.extend(off); // tripped
    let on_pin = [&[Level::Low; DISARMED + 1], [Level::High, Level::Low].as_slice()].concat();
    let on_pin: Vec<_> = on_pin.into_iter().map(OnPin::set).collect();
    let amplifier = Amplifier::new(Spi::new(&on_dac), Pin::new(&on_pin), CommandRange::TenVolts);
    let mut amplifier = amplifier.expect("answers");
    // The monitor shows the voltage of a tick ago; the sensor reads 1 V of a film at rest, with its noise.
    let at_rest = [6400, 6401].repeat(DISARMED);
    let mut monitor = adc(&[[0; DISARMED - 1].as_slice(), &[320]].concat());
    let mut sensor = adc(&at_rest[..DISARMED]);

    const RUNS: usize = DISARMED + 1;
    for tick in 0..DISARMED + 4 {
        match tick {
            DISARMED => device.arm().expect("the readings are healthy"),
            RUNS => {
                device.start(Mode::Voltage).expect("armed");
                device.set_voltage(2000.0).expect("within the limits");
            }
            _ => {}
        }
        let inputs = Inputs {
            interlock_closed: tick < DISARMED + 3,
            monitor_adc_v: monitor.volts().ok(),
            sensor_adc_v: sensor.volts().ok(),
        };
        let drive = device.tick(inputs);
        amplifier.apply(drive).expect("answers");
    }
    assert_eq!(device.state(), DriverState::Tripped(Cause::Interlock));

    // Every transaction took place, and no other.
    let (mut dac, mut enable) = amplifier.destroy();
    dac.done();
    enable.done();
    monitor.destroy().done();
    sensor.destroy().done();
    println!("the interlock opened: 0 V, amplifier disabled");
}
