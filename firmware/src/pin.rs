//! Pins by their registers, which are alike in every family of chips.

/// A pin whose port has its clock.
pub struct Pin {
    /// The first register of its port.
    port: usize,
    number: u8,
}

/// Registers of a port.
const MODER: usize = 0x00;
const PUPDR: usize = 0x0c;
const IDR: usize = 0x10;
const BSRR: usize = 0x18;
const AFRL: usize = 0x20;

#[allow(dead_code)] // no image uses all of them
impl Pin {
    /// Pin `number` of the port at this address. It belongs to the caller.
    pub const fn at(port: usize, number: u8) -> Self {
        Self { port, number }
    }

    fn register(&self, offset: usize) -> *mut u32 {
        (self.port + offset) as *mut u32
    }

    /// Sets a field of `width` bits of a register that its port's pins share. To be called before interrupts are on.
    fn set_field(&self, offset: usize, width: u8, place: u8, bits: u32) {
        let (register, shift) = (self.register(offset), width * place);
        let mask = ((1 << width) - 1) << shift;
        // SAFETY: the register of a port; the start alone changes it.
        unsafe { register.write_volatile(register.read_volatile() & !mask | bits << shift) };
    }

    /// Drives this level from the first moment on.
    pub fn output(self, high: bool) -> Self {
        self.set(high);
        self.set_field(MODER, 2, self.number, 0b01);
        self
    }

    pub fn analog(self) {
        self.set_field(PUPDR, 2, self.number, 0b00);
        self.set_field(MODER, 2, self.number, 0b11);
    }

    pub fn input_pulled_down(self) -> Self {
        self.set_field(PUPDR, 2, self.number, 0b10);
        self.set_field(MODER, 2, self.number, 0b00);
        self
    }

    /// Carries a signal of the chip, by the number of its function in the data sheet, pulled up or not at all.
    pub fn alternate(self, function: u32, pulled_up: bool) {
        self.set_field(AFRL + usize::from(self.number / 8 * 4), 4, self.number % 8, function);
        self.set_field(PUPDR, 2, self.number, pulled_up.into());
        self.set_field(MODER, 2, self.number, 0b10);
    }

    pub fn set(&self, high: bool) {
        // SAFETY: the register sets and clears single pins.
        unsafe { self.register(BSRR).write_volatile(1 << (self.number + if high { 0 } else { 16 })) };
    }

    /// The level at the pin, whatever drives it.
    pub fn is_high(&self) -> bool {
        // SAFETY: the pin's level is only read.
        unsafe { self.register(IDR).read_volatile() >> self.number & 1 != 0 }
    }
}
