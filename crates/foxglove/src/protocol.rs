//! The texts of the Foxglove WebSocket protocol, version 1.

use serde::Deserialize;
use serde_json::json;
use taxel_recorder::Topic;

/// Names of the protocol in a handshake. The second is that of Foxglove's SDK since 2025, the same but for its name.
pub(crate) const SUBPROTOCOLS: [&str; 2] = ["foxglove.websocket.v1", "foxglove.sdk.v1"];
/// The name of the message that the daemon is gone, by which it is taken back.
const GONE: &str = "taxeld";
/// The name of the message that a client is too slow; a newer one takes its place.
const SLOW: &str = "too-slow";

/// What there are channels of: what a recording has but raw CAN, which nothing in a viewer shows.
pub(crate) fn channels() -> impl Iterator<Item = Topic> {
    Topic::ALL.into_iter().filter(|topic| *topic != Topic::Can)
}

/// The number of a topic's channel.
fn channel_id(topic: Topic) -> u64 {
    topic as u64
}

/// The topic of a channel; none where there is no such channel.
pub(crate) fn topic_of(channel_id: u64) -> Option<Topic> {
    channels().find(|topic| self::channel_id(*topic) == channel_id)
}

/// How severe a status message is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Level {
    Info = 0,
    Warning = 1,
    Error = 2,
}

/// What a client is told first.
pub(crate) fn server_info(name: &str, session_id: &str) -> String {
    json!({ "op": "serverInfo", "name": name, "capabilities": [], "sessionId": session_id }).to_string()
}

/// Every channel.
pub(crate) fn advertise() -> String {
    let channels: Vec<_> = channels()
        .map(|topic| {
            json!({
                "id": channel_id(topic),
                "topic": topic.name(),
                "encoding": "cdr",
                "schemaName": topic.type_name(),
                "schema": topic.definition(),
                "schemaEncoding": "ros2msg",
            })
        })
        .collect();
    json!({ "op": "advertise", "channels": channels }).to_string()
}

/// Something to tell people.
pub(crate) fn status(level: Level, message: &str) -> String {
    json!({ "op": "status", "level": level as u8, "message": message }).to_string()
}

/// That the daemon is gone, until [`back`].
pub(crate) fn gone(why: &str) -> String {
    json!({ "op": "status", "level": Level::Warning as u8, "message": why, "id": GONE }).to_string()
}

/// Takes back that the daemon is gone.
pub(crate) fn back() -> String {
    json!({ "op": "removeStatus", "statusIds": [GONE] }).to_string()
}

/// That so many messages were lost so far.
pub(crate) fn too_slow(lost: u64) -> String {
    let message = format!("this client is too slow: it has lost {lost} messages");
    json!({ "op": "status", "level": Level::Warning as u8, "message": message, "id": SLOW }).to_string()
}

/// Bytes in front of a message: what it is, the client's number of the subscription, and the message's time.
pub(crate) const DATA_HEAD: usize = 13;

/// A message as it is sent.
pub(crate) fn message_data(subscription_id: u32, wall_ns: u64, data: &[u8]) -> Vec<u8> {
    const MESSAGE_DATA: u8 = 1;
    let mut bytes = Vec::with_capacity(DATA_HEAD + data.len());
    bytes.push(MESSAGE_DATA);
    bytes.extend_from_slice(&subscription_id.to_le_bytes());
    bytes.extend_from_slice(&wall_ns.to_le_bytes());
    bytes.extend_from_slice(data);
    bytes
}

/// What a client says.
#[derive(Debug, PartialEq, Eq, Deserialize)]
#[serde(tag = "op", rename_all = "camelCase", rename_all_fields = "camelCase")]
pub(crate) enum ClientText {
    /// It wants channels.
    Subscribe { subscriptions: Vec<Subscription> },
    /// It wants them no more.
    Unsubscribe { subscription_ids: Vec<u32> },
    /// What is for servers that can do more.
    #[serde(other)]
    Other,
}

/// A channel, and the number that the client gives it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(crate) struct Subscription {
    pub(crate) id: u32,
    pub(crate) channel_id: u64,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_message_has_its_subscription_and_time_in_front_little_endian() {
        let bytes = message_data(0x0403_0201, 0x0c0b_0a09_0807_0605, b"xy");
        assert_eq!(bytes, b"\x01\x01\x02\x03\x04\x05\x06\x07\x08\x09\x0a\x0b\x0cxy");
    }

    #[test]
    fn every_channel_has_a_topic_of_its_own_and_others_have_none() {
        let topics: Vec<_> = channels().map(|topic| topic_of(channel_id(topic))).collect();
        assert!(channels().map(Some).eq(topics));
        assert_eq!(topic_of(Topic::Can as u64), None);
        assert_eq!(topic_of(u64::MAX), None);
    }

    #[test]
    fn what_clients_say_is_read_as_the_protocol_writes_it() {
        let read = |text: &str| serde_json::from_str::<ClientText>(text);
        let subscribed =
            read(r#"{"op": "subscribe", "subscriptions": [{"id": 0, "channelId": 3}]}"#).unwrap();
        let wanted = vec![Subscription { id: 0, channel_id: 3 }];
        assert_eq!(
            subscribed,
            ClientText::Subscribe {
                subscriptions: wanted
            }
        );
        let unsubscribed = read(r#"{"op": "unsubscribe", "subscriptionIds": [0, 4294967295]}"#).unwrap();
        let wanted = vec![0, u32::MAX];
        assert_eq!(
            unsubscribed,
            ClientText::Unsubscribe {
                subscription_ids: wanted
            }
        );
        let other = read(r#"{"op": "getParameters", "parameterNames": []}"#).unwrap();
        assert_eq!(other, ClientText::Other);
        for wrong in [
            "",
            "[]",
            r#"{"op": 1}"#,
            r#"{"op": "subscribe", "subscriptions": [{"id": -1, "channelId": 3}]}"#,
        ] {
            assert!(read(wrong).is_err(), "{wrong}");
        }
    }
}
