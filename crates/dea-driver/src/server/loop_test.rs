//! The loop test at the board's side of the link.

use crate::chips::{AdcCode, AdcRange, DacCode};
use crate::control::{Controller, Followed, Inputs, Mode, Outputs, Step, Target, TickCodes, Ticked};
use crate::parameters::ControllerMemory;
use crate::safety::DriverState;
use crate::server::{Denial, Device};
use crate::wire::Reject;

/// The loop test, which takes time that the tick of an enabled amplifier may need.
#[allow(clippy::missing_errors_doc)] // as of `rest`
impl<M: ControllerMemory> Device<M> {
    /// [`Controller::rest`], and a controller at rest for [`tick_test`](Self::tick_test).
    ///
    /// # Errors
    ///
    /// [`Refusal::State`](crate::Refusal::State) while the amplifier is enabled, and [`Reject::NoParameters`].
    #[inline(never)] // the stack of other requests has no room for a controller
    pub fn rest(&mut self) -> Result<(), Denial> {
        let controller = self.disabled()?;
        controller.rest();
        self.test = Some(controller.at_rest());
        Ok(())
    }

    /// Whole ticks on `inputs`, of a controller of its own that has been at rest since [`rest`](Self::rest): it is armed and started
    /// in `mode` as soon as its readings are healthy, and given a target in every tick.
    ///
    /// # Errors
    ///
    /// As [`rest`](Self::rest); [`Reject::NoParameters`] as well if that was not called since they changed.
    pub fn tick_test<C: FromIterator<Ticked>>(&mut self, mode: Mode, inputs: &[TickCodes]) -> Result<C, Denial> {
        self.disabled()?;
        let controller = self.test.as_mut().ok_or(Denial::Rejected(Reject::NoParameters))?;
        Ok(inputs.iter().map(|&codes| tick_on_codes(controller, mode, codes)).collect())
    }

    /// [`Controller::step`] under each of `volts`.
    pub fn step<C: FromIterator<Step>>(&mut self, volts: &[f32]) -> Result<C, Denial> {
        let controller = self.disabled()?;
        Ok(volts.iter().map(|&volts| controller.step(volts)).collect())
    }

    /// [`Controller::follow`] to each of `targets`.
    pub fn follow<C: FromIterator<Followed>>(&mut self, mode: Mode, targets: &[Target]) -> Result<C, Denial> {
        let controller = self.disabled()?;
        Ok(targets.iter().map(|&target| controller.follow(mode, target)).collect())
    }

    fn disabled(&mut self) -> Result<&mut Controller<M>, Denial> {
        let off = self.is_off();
        let controller = self.installed()?;
        off?;
        Ok(controller)
    }
}

/// A tick of the loop test: codes in, codes out. It makes the requests of a host, which may be refused.
fn tick_on_codes<M: ControllerMemory>(controller: &mut Controller<M>, mode: Mode, codes: TickCodes) -> Ticked {
    let volts = |code| Some(AdcCode(code).volts(AdcRange::default()));
    let _ = match controller.supervisor().state() {
        DriverState::Disarmed => controller.arm(),
        DriverState::Armed => controller.start(mode),
        DriverState::Running | DriverState::Tripped(_) => Ok(()),
    };
    let _ = match mode {
        Mode::Voltage => controller.set_voltage(codes.target),
        Mode::Feedforward | Mode::Tracking => controller.set_reference(codes.target),
    };
    controller.heartbeat();
    let TickCodes { interlock_closed, monitor, sensor, .. } = codes;
    let inputs = Inputs { interlock_closed, monitor_adc_v: volts(monitor), sensor_adc_v: volts(sensor) };
    let Outputs { enable, dac_v, telemetry } = controller.tick(inputs);
    let command =
        if enable { DacCode::from_volts(dac_v, controller.parameters().command_range) } else { DacCode::ZERO };
    Ticked { enable, command: command.0, state: controller.supervisor().state(), predicted_m: telemetry.predicted_m }
}
