//! Tests of the chip by a gSPI master of their own, which moves its pins one by one.

mod board;
mod bus;
mod master;
mod network;
mod program;
