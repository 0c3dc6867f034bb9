//! The radio of a Pico W, and ground stations at it.

mod start;
