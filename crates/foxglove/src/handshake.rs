//! From a connection to a WebSocket of the protocol.

use crate::protocol::SUBPROTOCOLS;
use crate::stream::Stream;
use std::sync::Arc;
use tokio::net::TcpStream;
use tokio::sync::{OwnedSemaphorePermit, Semaphore};
use tungstenite::handshake::HandshakeError;
use tungstenite::handshake::server::{ErrorResponse, Request, Response};
use tungstenite::http::{HeaderValue, StatusCode};
use tungstenite::protocol::WebSocketConfig;
use tungstenite::{Error, WebSocket};

/// The most bytes of a client's message: a thousand subscriptions are 30,000.
const MOST_OF_CLIENT: usize = 64 << 10;
const PROTOCOL: &str = "sec-websocket-protocol";

/// Lets a client in that asks as the protocol says, if one of the places is free, which it then has; others are answered
/// what there is here.
pub(crate) async fn shake(
    socket: &Arc<TcpStream>,
    places: Arc<Semaphore>,
) -> Result<(WebSocket<Stream>, OwnedSemaphorePermit), Error> {
    let config = WebSocketConfig::default()
        .read_buffer_size(4 << 10)
        .write_buffer_size(64 << 10)
        .max_message_size(Some(MOST_OF_CLIENT))
        .max_frame_size(Some(MOST_OF_CLIENT));
    // Asked for once, when the request is there, and kept until the answer is sent.
    let (taken, place) = std::sync::mpsc::sync_channel(1);
    #[expect(clippy::result_large_err, reason = "so is tungstenite's own callback")]
    let answer = move |request: &Request, mut response: Response| {
        let Some(name) = subprotocol(request) else {
            let names = SUBPROTOCOLS.join(" and ");
            return Err(refusal(
                StatusCode::BAD_REQUEST,
                format!("here is spoken {names}\n"),
            ));
        };
        let Ok(place) = places.try_acquire_owned() else {
            return Err(refusal(
                StatusCode::SERVICE_UNAVAILABLE,
                "there are as many clients as there may be\n".into(),
            ));
        };
        let _ = taken.try_send(place);
        let name = HeaderValue::from_static(name);
        response.headers_mut().insert(PROTOCOL, name);
        Ok(response)
    };
    let mut shaken = tungstenite::accept_hdr_with_config(Stream::new(socket.clone()), answer, Some(config));
    loop {
        match shaken {
            Ok(websocket) => {
                let place = place.try_recv().map_err(|_| Error::ConnectionClosed)?;
                return Ok((websocket, place));
            }
            Err(HandshakeError::Failure(error)) => {
                if !matches!(error, Error::Http(_) | Error::Io(_)) {
                    // Whoever asks otherwise, as a browser does that the address was typed into.
                    let _ = socket.try_write(&not_a_websocket());
                }
                return Err(error);
            }
            Err(HandshakeError::Interrupted(mut shaking)) => {
                // The answer is shorter than any socket's buffer: it waits for the client to ask.
                socket.readable().await?;
                shaking.get_mut().get_mut().begin_turn();
                shaken = shaking.handshake();
            }
        }
    }
}

/// The name of the protocol that is spoken with a client, of those that it offers.
fn subprotocol(request: &Request) -> Option<&'static str> {
    let offered = request.headers().get_all(PROTOCOL).iter();
    let offered = offered.filter_map(|value| value.to_str().ok());
    let mut offered = offered.flat_map(|value| value.split(',').map(str::trim));
    offered.find_map(|name| SUBPROTOCOLS.into_iter().find(|spoken| *spoken == name))
}

fn refusal(status: StatusCode, text: String) -> ErrorResponse {
    let mut response = ErrorResponse::new(Some(text));
    *response.status_mut() = status;
    let close = HeaderValue::from_static("close");
    response.headers_mut().insert("connection", close);
    response
}

fn not_a_websocket() -> Vec<u8> {
    let text = "This is a tactile hand, live, for Foxglove and Lichtblick: open a connection of the kind \"Foxglove \
                WebSocket\" there, to ws:// and this address.\n";
    let length = text.len();
    format!(
        "HTTP/1.1 426 Upgrade Required\r\nUpgrade: websocket\r\nConnection: Upgrade, close\r\nContent-Type: text/plain\r\n\
         Content-Length: {length}\r\n\r\n{text}"
    )
    .into_bytes()
}
