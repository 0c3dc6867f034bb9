//! Types and functions that follow from the rows of the table of messages.

/// Declares [`Message`](super::Message), [`StreamKind`](super::StreamKind) and [`Stream`](super::Stream), from a row for
/// each message.
macro_rules! messages {
    (
        streams of the vehicle {
            $($vehicle:ident($vehicle_data:ty): $vehicle_rate:expr, $build_vehicle:path;)+
        }
        streams of packs {
            $($pack:ident($pack_data:ty): $pack_rate:expr, $subject:expr, $build_pack:path;)+
        }
        answers {
            $($answer:ident($answer_data:ty);)+
        }
    ) => {
        /// A message that can be sent regularly.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        #[cfg_attr(target_os = "none", derive(defmt::Format))]
        pub enum StreamKind {
            $(#[doc = concat!("[`", stringify!($vehicle_data), "`]")] $vehicle,)+
            $(#[doc = concat!("[`", stringify!($pack_data), "`]")] $pack,)+
        }

        impl StreamKind {
            /// Their number.
            pub const COUNT: usize = [$(Self::$vehicle,)+ $(Self::$pack,)+].len();

            /// All of them, in the order of the table.
            pub const ALL: [Self; Self::COUNT] = [$(Self::$vehicle,)+ $(Self::$pack,)+];

            /// The message's id.
            pub const fn message_id(self) -> u32 {
                match self {
                    $(Self::$vehicle => <$vehicle_data as MessageData>::ID,)+
                    $(Self::$pack => <$pack_data as MessageData>::ID,)+
                }
            }

            /// The message's name in MAVLink.
            pub const fn name(self) -> &'static str {
                match self {
                    $(Self::$vehicle => <$vehicle_data as MessageData>::NAME,)+
                    $(Self::$pack => <$pack_data as MessageData>::NAME,)+
                }
            }

            /// Its rate unless a ground station asks for another interval.
            pub const fn default_rate(self) -> DefaultRate {
                match self {
                    $(Self::$vehicle => $vehicle_rate,)+
                    $(Self::$pack => $pack_rate,)+
                }
            }

            /// Its subject.
            pub const fn subject(self) -> Subject {
                match self {
                    $(Self::$vehicle => Subject::Vehicle,)+
                    $(Self::$pack => $subject,)+
                }
            }

            /// The stream of this message and, unless it is about the whole vehicle, of `pack`.
            pub const fn of(self, pack: Pack) -> Stream {
                match self {
                    $(Self::$vehicle => Stream::$vehicle,)+
                    $(Self::$pack => Stream::$pack(pack),)+
                }
            }
        }

        /// A message that can be sent regularly, of the vehicle or of one pack.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        #[cfg_attr(target_os = "none", derive(defmt::Format))]
        pub enum Stream {
            $(#[doc = concat!("[`", stringify!($vehicle_data), "`]")] $vehicle,)+
            $(#[doc = concat!("[`", stringify!($pack_data), "`] of this pack")] $pack(Pack),)+
        }

        impl Stream {
            /// Its message.
            pub const fn kind(self) -> StreamKind {
                match self {
                    $(Self::$vehicle => StreamKind::$vehicle,)+
                    $(Self::$pack(_) => StreamKind::$pack,)+
                }
            }

            /// Its pack; `None` if it is of the vehicle.
            pub const fn pack(self) -> Option<Pack> {
                match self {
                    $(Self::$vehicle => None,)+
                    $(Self::$pack(pack) => Some(pack),)+
                }
            }

            /// The message of this stream, from the state at this moment.
            pub fn build(self, state: &SystemState<'_>) -> Message {
                match self {
                    $(Self::$vehicle => Message::$vehicle($build_vehicle(state)),)+
                    $(Self::$pack(pack) => Message::$pack($build_pack(state, pack)),)+
                }
            }
        }

        /// A message on its way out.
        ///
        /// The `mavlink` crate's own enum of all messages would link the serialisers of the whole dialect (over 100 KB).
        #[derive(Clone, Debug, PartialEq)]
        pub enum Message {
            $(#[doc = concat!("[`", stringify!($vehicle_data), "`]")] $vehicle($vehicle_data),)+
            $(#[doc = concat!("[`", stringify!($pack_data), "`]")] $pack($pack_data),)+
            $(#[doc = concat!("[`", stringify!($answer_data), "`]")] $answer($answer_data),)+
        }

        impl Message {
            /// Writes the message as a MAVLink 2 frame into `frame`.
            pub(in crate::mavlink) fn write(&self, header: MavHeader, frame: &mut MAVLinkV2MessageRaw) {
                match self {
                    $(Self::$vehicle(data) => frame.serialize_message_data(header, data),)+
                    $(Self::$pack(data) => frame.serialize_message_data(header, data),)+
                    $(Self::$answer(data) => frame.serialize_message_data(header, data),)+
                }
            }
        }
    };
}

pub(super) use messages;
