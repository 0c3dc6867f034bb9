//! A Pico on the bench: power it up with a firmware, let time pass, look at its pins and wires.

use std::collections::BTreeMap;
use std::ops::Range;

use super::access_log::{BusErrorRecord, UnmodelledAccess};
use super::adc::{AdcCurve, AdcFault, AdcInput, Conversion};
use super::boot_rom;
use super::bus::{SystemBus, Width};
use super::circuit::Circuit;
use super::clock::{Cycle, cycles, micros};
use super::cpu::{Cpu, CpuState};
use super::cyw43::Cyw43;
use super::firmware::Firmware;
use super::flash::FlashChip;
use super::flash::FlashMake;
use super::gpio::{PinWire, Pulses};
use super::i2c::I2c;
use super::interrupts::InterruptLines;
use super::log::{LogDecoder, LogLine};
use super::memory::Memory;
use super::peripheral::Peripheral;
use super::pins::{I2cPins, PinDrive, SpiPins, UartPins, driven_level, pin_drive};
use super::pio::PinDevice;
use super::pwm::PwmOutput;
use super::random::Random;
use super::reset::ResetRecord;
use super::rtt::RttWatch;
use super::spi::Spi;
use super::ssi::Ssi;
use super::uart::{BitTime, Uart};
use super::usb::UsbHost;

pub(super) const STACK_POINTER: usize = 13;

/// What no program writes by chance into many words in a row.
const STACK_PAINT: u32 = 0x5ac3_7e19;

/// Decides what the radio's faults do.
const WIFI_SEED: u64 = 0x4343_9000;

/// The emulated board.
#[derive(Clone)]
pub struct Board {
    pub(super) cpu: Cpu,
    pub(super) bus: SystemBus,
    pub(super) lines: InterruptLines,
    pub(super) log: LogDecoder,
    pub(super) resets: Vec<ResetRecord>,
    pub(super) awake_cycles: u64,
    /// The cores a debugger has halted, one bit each.
    pub(super) halted_cores: u32,
    /// The deepest the stack has been.
    pub(super) lowest_stack_pointer: u32,
    /// Where the runs asked for so far end: overshoot by an instruction does not add up.
    pub(super) run_end: Cycle,
    pub(super) powered: bool,
    firmware: Firmware,
    seeds: Random,
}

impl Board {
    /// Switch a board on whose flash holds `firmware`. The seed decides what is in RAM and what
    /// the analogue noise is; the same seed and the same stimuli give the same run.
    pub fn power_up(firmware: &Firmware, seed: u64) -> Self {
        let mut seeds = Random::new(seed);
        // Not from the sequence below, which stays what it is if flash needs no chance.
        let flash = FlashChip::new(firmware.shared_flash(), !seed);
        let unique_id = Random::new(!seed).next_u64().to_be_bytes();
        let mut memory = Memory::new(boot_rom::image(), flash);
        Random::new(seeds.next_u64()).fill(&mut memory.ram);
        let mut bus = SystemBus::new(memory, seeds.next_u64());
        bus.soc.ssi = Ssi::new(FlashMake::w25q16jv(unique_id));
        bus.rtt = RttWatch::new(firmware.find_symbol("_SEGGER_RTT"));
        let mut board = Self {
            cpu: Cpu::at_reset(0, 0, &mut seeds),
            bus,
            lines: InterruptLines::default(),
            log: LogDecoder::new(firmware.log_table()),
            resets: Vec::new(),
            awake_cycles: 0,
            halted_cores: 0,
            lowest_stack_pointer: u32::MAX,
            run_end: 0,
            powered: true,
            firmware: firmware.clone(),
            seeds,
        };
        board.boot();
        board
    }

    pub(super) fn next_seed(&mut self) -> u64 {
        self.seeds.next_u64()
    }

    // ----- Time -------------------------------------------------------------------------------

    /// Microseconds since power-up. A reset does not restart this clock.
    pub fn time_us(&self) -> u64 {
        micros(self.bus.now)
    }

    /// Cycles of `clk_sys` since power-up.
    pub fn time_cycles(&self) -> Cycle {
        self.bus.now
    }

    // ----- Wires and voltages -----------------------------------------------------------------

    /// What left and reached a UART.
    pub fn uart(&mut self, number: usize) -> &mut Uart {
        &mut self.bus.soc.uarts[number]
    }

    /// Solder a UART's wire to other pins (GP0/GP1 for UART0 and GP8/GP9 for UART1 at first).
    pub fn wire_uart(&mut self, number: usize, pins: UartPins) {
        pins.check(number);
        self.bus.uart_pins[number] = pins;
        self.bus.connect_pins();
        self.bus.attention = true;
    }

    /// Take the wire off the pin at which a UART receives: it is open from now on.
    pub fn disconnect_uart_receiver(&mut self, number: usize) {
        let now = self.bus.now;
        self.bus.soc.uarts[number].disconnect_receiver(now);
        self.bus.attention = true;
    }

    /// Send bytes to the chip, back to back, from `at_us` on or when the wire is free. Returns the
    /// time at which the last stop bit is over. Uses the baud rate the firmware has programmed;
    /// panics before it has.
    pub fn uart_send(&mut self, number: usize, at_us: u64, bytes: &[u8]) -> u64 {
        let bit = self.bus.soc.uarts[number].programmed_bit();
        let bit = bit.unwrap_or_else(|| panic!("UART{number} has no baud rate yet: use uart_send_at_baud"));
        self.send(number, at_us, bytes, bit)
    }

    /// Send bytes to the chip at a baud rate of the sender's own.
    pub fn uart_send_at_baud(&mut self, number: usize, at_us: u64, bytes: &[u8], baud: u32) -> u64 {
        self.send(number, at_us, bytes, BitTime::of_baud(baud))
    }

    fn send(&mut self, number: usize, at_us: u64, bytes: &[u8], bit: BitTime) -> u64 {
        self.bus.attention = true;
        let start = cycles(at_us).max(self.bus.now);
        micros(self.bus.soc.uarts[number].send_to_chip(bytes, start, bit))
    }

    /// The bus at an I2C block: its devices, its faults, what went over it.
    pub fn i2c(&mut self, number: usize) -> &mut I2c {
        self.bus.attention = true;
        let i2c = &mut self.bus.soc.i2cs[number];
        i2c.advance(self.bus.now);
        i2c
    }

    /// Solder an I2C bus to other pins (GP4/GP5 for I2C0 and GP14/GP15 for I2C1 at first).
    pub fn wire_i2c(&mut self, number: usize, pins: I2cPins) {
        pins.check(number);
        self.bus.i2c_pins[number] = pins;
        self.bus.connect_pins();
        self.bus.attention = true;
    }

    /// The bus at SPI1: its devices, what went over it.
    pub fn spi1(&mut self) -> &mut Spi {
        self.bus.attention = true;
        self.bus.soc.spi1.advance(self.bus.now);
        &mut self.bus.soc.spi1
    }

    /// Solder the wires of SPI1 to other pins (SCK, TX and RX are GP10, GP11 and GP12 at first).
    pub fn wire_spi1(&mut self, pins: SpiPins) {
        pins.check();
        self.bus.spi1_pins = pins;
        self.bus.connect_pins();
        self.bus.attention = true;
    }

    /// The host at the USB port; its cable is not connected at first.
    pub fn usb(&mut self) -> &mut UsbHost {
        self.bus.attention = true;
        let usb = &mut self.bus.soc.usb;
        usb.advance(self.bus.now);
        &mut usb.host
    }

    /// Makes it a Pico W, before the first run: the radio at GP23, GP24, GP25 and GP29. What is put on channel 3 of the ADC
    /// is a third of VSYS then, and reaches it while GP25 is high; else the pin floats, at 0 V unless it is charged.
    pub fn attach_wifi(&mut self) {
        self.bus.soc.wifi = Some(Box::new(Cyw43::new(WIFI_SEED)));
        self.bus.observe_pins();
        self.bus.attention = true;
    }

    /// Has GP29 of a Pico W, to which nothing is connected while GP25 is low, float to this voltage unless it is pulled down.
    pub fn float_vsys_pin(&mut self, volts: f64) {
        self.bus.soc.adc.float_vsys_pin(volts);
    }

    /// The radio. Panics without one.
    pub fn wifi(&mut self) -> &mut Cyw43 {
        let now = self.bus.now;
        self.bus.attention = true;
        self.bus.soc.advance_wifi(now);
        let wifi = self.bus.soc.wifi.as_mut();
        let wifi = wifi.unwrap_or_else(|| panic!("a Pico has no radio: use attach_wifi"));
        wifi.advance(now);
        wifi
    }

    /// Put a signal on an ADC channel: 0 to 3 are GP26 to GP29, 4 is the temperature sensor.
    pub fn adc_input(&mut self, channel: usize, input: AdcInput) {
        self.bus.soc.adc.set_input(channel, input);
    }

    /// Noise on the ADC inputs that are given as voltages: standard deviation in volts.
    pub fn adc_noise(&mut self, volts: f64) {
        self.bus.soc.adc.set_noise(volts);
    }

    /// The codes that the converter makes of voltages: those of the RP2040 at first.
    pub fn adc_curve(&mut self, curve: AdcCurve) {
        self.bus.soc.adc.set_curve(curve);
    }

    /// Connect a pack, and motors at H-bridges, to the board. What of it the converter sees is an [`AdcInput`] of each channel.
    pub fn attach_circuit(&mut self, circuit: Circuit) {
        self.bus.attach_circuit(circuit);
    }

    /// The circuit, at this moment. Panics without one.
    pub fn circuit(&mut self) -> &mut Circuit {
        let now = self.bus.now;
        let circuit = self.bus.soc.adc.circuit.as_mut();
        let circuit = circuit.unwrap_or_else(|| panic!("no circuit: use attach_circuit"));
        circuit.advance(now);
        circuit
    }

    pub fn adc_fault(&mut self, fault: AdcFault) {
        let now = self.bus.now;
        self.bus.soc.adc.set_fault(fault, now);
        self.bus.attention = true;
    }

    /// Conversions finished since power-up.
    pub fn adc_conversions(&self) -> u64 {
        self.bus.soc.adc.conversions()
    }

    /// Take the record of the conversions since it was taken last (at most the last 65536).
    pub fn take_adc_record(&mut self) -> Vec<Conversion> {
        self.bus.soc.adc.take_record()
    }

    /// Put a level on a pin, or release it, from now on. What is scheduled comes all the same.
    pub fn drive_pin(&mut self, pin: usize, wire: PinWire) {
        self.bus.soc.gpio.advance(self.bus.now);
        self.bus.soc.gpio.connect(pin, wire);
        self.bus.attention = true;
    }

    /// Send pulses to a pin: each is high for `high_us` and begins `period_us` after the one before.
    /// Until the first the pin is what it was. Returns the time at which the last one falls.
    pub fn pulses(
        &mut self,
        pin: usize,
        first_rise_us: u64,
        high_us: u64,
        period_us: u64,
        count: u64,
    ) -> u64 {
        let pulses = Pulses {
            first_rise: cycles(first_rise_us).max(self.bus.now),
            high: cycles(high_us),
            period: cycles(period_us),
            count,
        };
        let mut end = self.bus.now;
        for (at, wire) in pulses.changes() {
            self.bus.soc.gpio.schedule(at, pin, wire);
            end = at;
        }
        self.bus.attention = true;
        micros(end)
    }

    /// The level at which the processor or the PWM drives a pin; `None` when neither does.
    pub fn pin_level(&self, pin: usize) -> Option<bool> {
        driven_level(&self.bus.chip, &self.bus.soc, pin, self.bus.now)
    }

    /// What the PWM makes of a pin; `None` when it does not drive it.
    pub fn pwm_output(&self, pin: usize) -> Option<PwmOutput> {
        match pin_drive(&self.bus.chip, &self.bus.soc, pin, self.bus.now) {
            PinDrive::Pwm(output) => Some(output),
            PinDrive::Nothing | PinDrive::Level(_) => None,
        }
    }

    // ----- What can be seen inside --------------------------------------------------------------

    /// The log so far, oldest line first.
    pub fn log_lines(&self) -> &[LogLine] {
        &self.log.lines
    }

    /// Take the log lines so far.
    pub fn take_log(&mut self) -> Vec<LogLine> {
        std::mem::take(&mut self.log.lines)
    }

    /// Every reset since power-up.
    pub fn resets(&self) -> &[ResetRecord] {
        &self.resets
    }

    /// Whether the board has power: a cut ends with [`Self::power_cycle`].
    pub fn is_powered(&self) -> bool {
        self.powered
    }

    pub fn cpu_state(&self) -> CpuState {
        self.cpu.state()
    }

    pub fn is_locked_up(&self) -> bool {
        self.cpu.state() == CpuState::LockedUp
    }

    /// Number of the exception being handled; 0 in thread mode, 3 in HardFault.
    pub fn active_exception(&self) -> u32 {
        self.cpu.active_exception()
    }

    /// R0 to R12, SP (13), LR (14), PC (15).
    pub fn register(&self, number: usize) -> u32 {
        self.cpu.core.reg(number)
    }

    pub fn pc(&self) -> u32 {
        self.register(15)
    }

    /// Instructions executed since power-up.
    pub fn instructions(&self) -> u64 {
        self.bus.instructions
    }

    /// Lines of 8 bytes that the cache in front of the flash has had to read from the chip since power-up.
    pub fn xip_misses(&self) -> u64 {
        self.bus.soc.xip_control.cache.misses()
    }

    /// Cycles since power-up in which the processor was not asleep.
    pub fn awake_cycles(&self) -> u64 {
        self.awake_cycles
    }

    /// The lowest value SP has had since power-up or since [`Self::forget_stack_use`], resets and handlers
    /// included.
    pub fn lowest_stack_pointer(&self) -> u32 {
        self.lowest_stack_pointer
    }

    /// The most bytes of the firmware's stack that were used. What the boot ROM's own functions take is not in it: they are
    /// not executed instruction by instruction.
    pub fn stack_used_bytes(&self) -> u32 {
        self.symbol("_stack_start")
            .saturating_sub(self.lowest_stack_pointer)
    }

    /// How many bytes of the firmware's stack hold something else than the paint of the last
    /// [`Self::forget_stack_use`], counted from the deepest. What was reserved and not written does not show.
    pub fn stack_painted_over_bytes(&self) -> u32 {
        let (end, start) = (self.symbol("_stack_end"), self.symbol("_stack_start"));
        let deepest = (end..start)
            .step_by(4)
            .find(|address| self.read_word(*address) != STACK_PAINT);
        start - deepest.unwrap_or(start)
    }

    /// Restart the search for the deepest stack, and paint what is free of it now.
    pub fn forget_stack_use(&mut self) {
        self.lowest_stack_pointer = u32::MAX;
        for address in (self.symbol("_stack_end")..self.register(STACK_POINTER)).step_by(4) {
            self.write_memory(address, &STACK_PAINT.to_le_bytes());
        }
    }

    /// Room for the firmware's stack.
    pub fn stack_bytes(&self) -> u32 {
        self.symbol("_stack_start") - self.symbol("_stack_end")
    }

    /// Accesses to addresses where nothing is (the first 1024).
    pub fn bus_errors(&self) -> &[BusErrorRecord] {
        &self.bus.accesses.bus_errors
    }

    /// Accesses to blocks that are not modelled, by name of the block.
    pub fn unmodelled(&self) -> &BTreeMap<&'static str, UnmodelledAccess> {
        &self.bus.accesses.unmodelled
    }

    /// How close to its time-out the watchdog was fed, at the closest, in microseconds.
    pub fn smallest_watchdog_slack_us(&self) -> Option<u64> {
        self.bus.soc.watchdog.smallest_slack_us()
    }

    pub fn watchdog_is_enabled(&self) -> bool {
        self.bus.soc.watchdog.is_enabled()
    }

    /// What the firmware has made of the clocks; the emulator itself runs at 125 MHz.
    pub fn programmed_clk_sys_hz(&self) -> u32 {
        self.bus.chip.sys_clk_hz()
    }

    /// Record when the register at this address is read from now on, instead of any other.
    pub fn watch_reads(&mut self, address: u32) {
        self.bus.accesses.watched = Some(address);
    }

    /// Take the times at which it was read since this was asked last.
    pub fn take_reads(&mut self) -> Vec<Cycle> {
        std::mem::take(&mut self.bus.accesses.reads)
    }

    /// Address of a symbol of the firmware. Panics when it has none of this name.
    pub fn symbol(&self, name: &str) -> u32 {
        self.firmware.symbol(name)
    }

    /// Addresses of a section of the firmware. Panics when it has none of this name.
    pub fn section(&self, name: &str) -> Range<u32> {
        self.firmware.section(name)
    }

    /// Read ROM, flash or RAM. Panics outside of them.
    pub fn read_memory(&self, address: u32, length: usize) -> Vec<u8> {
        let byte = |index: usize| self.bus.memory.load(address + index as u32, Width::Byte);
        let byte = |index| byte(index).unwrap_or_else(|| panic!("no memory at {address:#x} + {index}"));
        (0..length).map(|index| byte(index) as u8).collect()
    }

    /// Read a word of ROM, flash or RAM. Panics outside of them.
    pub fn read_word(&self, address: u32) -> u32 {
        let word = self.bus.memory.load(address, Width::Word);
        word.unwrap_or_else(|| panic!("no memory at {address:#x}"))
    }

    /// Write RAM behind the firmware's back. Panics outside of it.
    pub fn write_memory(&mut self, address: u32, bytes: &[u8]) {
        for (index, &byte) in bytes.iter().enumerate() {
            let stored = self
                .bus
                .store(address + index as u32, u32::from(byte), Width::Byte);
            assert!(stored.is_ok(), "no RAM at {address:#x} + {index}");
        }
    }

    /// Read a peripheral register as the processor would, with its side effects.
    pub fn read_register(&mut self, address: u32) -> u32 {
        self.bus
            .load(address, Width::Word)
            .unwrap_or_else(|_| panic!("no register at {address:#x}"))
    }

    /// Write a peripheral register as the processor would.
    pub fn write_register(&mut self, address: u32, value: u32) {
        assert!(
            self.bus.store(address, value, Width::Word).is_ok(),
            "no register at {address:#x}"
        );
    }

    /// Set the TIMER's counter, for a test of what happens after 2^32 µs.
    pub fn preset_timer(&mut self, count: u64) {
        self.bus.soc.timer.set_count(count, self.bus.now);
        self.bus.attention = true;
    }
}
