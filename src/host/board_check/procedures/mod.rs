//! What is done with the board, in the order of [`super::run`]. Each leaves evidence, and judges nothing.

mod calibrate;
mod connect;
mod keep_parameter;
mod listen;
mod parameters;
mod provoke_fault;
mod turn_motors;

pub(super) use calibrate::calibrate;
pub(super) use connect::{connect, identify};
pub(super) use keep_parameter::keep_parameter;
pub(super) use listen::listen;
pub(super) use parameters::{download, set};
pub(super) use provoke_fault::provoke_fault;
pub(super) use turn_motors::turn_motors;
