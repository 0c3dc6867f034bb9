//! The log: what is recorded, and what of it goes to flash next.

mod queue;
#[expect(
    clippy::module_inception,
    reason = "the file is named after its type, and the folder as well"
)]
mod recording;
mod share;
mod space;
mod step;
mod stream;

pub use recording::LogFailure;
pub(super) use recording::Recording;
pub(super) use share::Detail;
pub use step::LogStep;

#[cfg(test)]
mod tests;
