//! The metrics over HTTP: clients are answered side by side, and none can keep another one waiting.

use super::families::Format;
use super::shared_ask::SharedAsk;
use super::{Daemon, text};
use crate::notices;
use std::collections::VecDeque;
use std::io;
use std::sync::Arc;
use std::time::Duration;
use tokio::io::{AsyncBufReadExt, AsyncReadExt, AsyncWriteExt, BufReader};
use tokio::net::tcp::ReadHalf;
use tokio::net::{TcpListener, TcpStream};
use tokio::task::JoinHandle;
use tokio::time::{sleep, timeout};

/// How long a client may take for its whole request, and again to take the answer.
const PATIENCE: Duration = Duration::from_secs(2);
/// After a connection could not be taken.
const TRY_AGAIN: Duration = Duration::from_millis(100);
/// The most bytes of a request that are read.
const REQUEST: u64 = 8192;
/// Most clients at once. One more takes the place of the one that came first: who has not asked by then is no scraper.
const CLIENTS: usize = 64;

/// Answers clients until the program is ended.
pub(super) fn serve(listener: std::net::TcpListener, daemon: Daemon) -> anyhow::Result<()> {
    listener.set_nonblocking(true)?;
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build()?;
    let daemon = Arc::new(SharedAsk::new(move || daemon.status()));
    runtime.block_on(async {
        let listener = TcpListener::from_std(listener)?;
        let mut clients: VecDeque<JoinHandle<()>> = VecDeque::new();
        let mut is_failing = false;
        loop {
            let client = match listener.accept().await {
                Ok((client, _)) => client,
                Err(error) => {
                    // Out of file descriptors, most likely. Said once, however long it lasts.
                    if !std::mem::replace(&mut is_failing, true) {
                        notices::warn(&format!(
                            "taxel: cannot take a connection: {error}; it is tried again every {TRY_AGAIN:?}"
                        ));
                    }
                    sleep(TRY_AGAIN).await;
                    continue;
                }
            };
            is_failing = false;
            clients.retain(|client| !client.is_finished());
            if clients.len() == CLIENTS
                && let Some(first) = clients.pop_front()
            {
                first.abort();
            }
            let daemon = daemon.clone();
            clients.push_back(tokio::spawn(async move {
                // A client that leaves early is none of our business.
                let _ = attend(client, &daemon).await;
            }));
        }
    })
}

async fn attend(mut client: TcpStream, daemon: &SharedAsk) -> io::Result<()> {
    let (read, mut write) = client.split();
    let request = timeout(PATIENCE, Request::read(read)).await??;
    let answer = request.answer(daemon).await;
    timeout(PATIENCE, write.write_all(answer.as_bytes())).await?
}

/// What a client asks for.
struct Request {
    first_line: String,
    format: Format,
}

impl Request {
    async fn read(client: ReadHalf<'_>) -> io::Result<Self> {
        let mut client = BufReader::new(client.take(REQUEST));
        let mut first_line = String::new();
        client.read_line(&mut first_line).await?;
        let mut format = Format::Prometheus;
        let mut line = String::new();
        while client.read_line(&mut line).await? > 2 {
            if let Some((name, value)) = line.split_once(':')
                && name.eq_ignore_ascii_case("accept")
            {
                format = Format::accepted(value);
            }
            line.clear();
        }
        Ok(Self { first_line, format })
    }

    async fn answer(&self, daemon: &SharedAsk) -> String {
        let (method, rest) = self.first_line.split_once(' ').unwrap_or_default();
        let path = (rest.split([' ', '?']).next()).filter(|_| matches!(method, "GET" | "HEAD"));
        let (status, kind, body) = match path {
            Some("/metrics") => {
                let told = daemon.status().await;
                let body = text::of(told.as_deref(), self.format);
                ("200 OK", self.format.content_type(), body)
            }
            Some(_) => (
                "404 Not Found",
                "text/plain",
                "metrics are at /metrics\n".to_owned(),
            ),
            None => (
                "405 Method Not Allowed",
                "text/plain",
                "GET /metrics\n".to_owned(),
            ),
        };
        let length = body.len();
        let body = if method == "HEAD" { String::new() } else { body };
        format!(
            "HTTP/1.1 {status}\r\nContent-Type: {kind}\r\nContent-Length: {length}\r\nConnection: close\r\n\r\n{body}"
        )
    }
}
