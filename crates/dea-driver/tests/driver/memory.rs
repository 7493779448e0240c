//! A bit that flips in the program is noticed and latched. Bits of the RAM: campaign, `flips`.

use dea_driver::server::Image;
use dea_driver::wire::{Answer, Command};
use dea_driver::{Cause, DriverState, Refusal};

use crate::board::Program;
use crate::host::Host;

#[test]
fn every_bit_of_an_image_is_in_its_sum() {
    for length in [1, 255, 256, 257, 600] {
        let mut words: Vec<u32> = (0..length).map(|k: u32| k.wrapping_mul(0x9e37_79b9)).collect();
        let steps = words.len().div_ceil(256);
        let mut image = Image::new(&words);
        for bit in 0..32 * words.len() {
            assert!((0..2 * steps).all(|_| image.is_intact(&words)), "{length} words");
            words[bit / 32] ^= 1 << (bit % 32);
            assert!(!(0..steps).all(|_| image.is_intact(&words)), "bit {bit} of {length} words");
            words[bit / 32] ^= 1 << (bit % 32);
        }
    }
}

/// In every state; it stays for as long as the program is damaged, whatever is acknowledged.
#[test]
fn a_bit_that_flips_in_the_program_is_latched() {
    for runs in [false, true] {
        let mut host = Host::with_parameters();
        let words = vec![0x5555_aaaa; 5000];
        host.bench.program = Some(Program { image: Image::new(&words), words });
        if runs {
            host.arm();
        }
        let turn = |host: &mut Host| {
            host.tick();
            host.session.turn(core::iter::empty(), &mut host.bench, |_| ());
        };
        (0..100).for_each(|_| turn(&mut host));
        let before = host.state();
        assert_eq!(before, if runs { DriverState::Armed } else { DriverState::Disarmed });
        host.bench.program.as_mut().expect("there").words[4999] ^= 1;
        (0..40).for_each(|_| turn(&mut host));
        let tripped = DriverState::Tripped(Cause::Memory);
        assert_eq!((host.state(), host.bench.drive.enable), (tripped, false));
        host.done(Command::Acknowledge);
        (0..40).for_each(|_| turn(&mut host));
        assert_eq!(host.ask(Command::Arm), Answer::Refused(Refusal::State(tripped)));
    }
}
