//! The board's I2C bus, at SDA GP14 and SCL GP15.

use std::cell::RefCell;
use std::rc::Rc;

/// The bus is that of I2C1.
pub const BUS: usize = 1;

/// A device that a test keeps a hand on.
pub fn shared<D>(device: D) -> Rc<RefCell<D>> {
    Rc::new(RefCell::new(device))
}
