//! Access control of the service's ports: refuses connections of web pages without permission, and foreign names of this machine.
//!
//! A page of any site can open a WebSocket to a local port; the browser then sends the page's `Origin`. The `Host` header reveals
//! a site that resolves its name to this machine (DNS rebinding). Programs send no `Origin`, and connect to an address or to
//! `localhost`.

use std::net::{IpAddr, SocketAddr};

/// Access rules of a port.
#[derive(Clone, Debug)]
pub(crate) struct Access {
    /// Origins of permitted web pages.
    origins: Vec<String>,
    hosts: Hosts,
}

/// Permitted values of the `Host` header.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Hosts {
    /// Loopback addresses and `localhost`.
    Loopback,
    /// Any name: the service accepts other machines, which may use any name for this machine.
    Any,
}

/// Reason for a refused connection.
#[derive(Debug, PartialEq, Eq, thiserror::Error)]
pub(crate) enum Forbidden {
    #[error("pages of `{0}` may not connect; use `flotor emulate haply-service --allow-origin {0}`")]
    Origin(String),
    #[error("`{0}` is not a name of the loopback interface; connect to 127.0.0.1 or localhost")]
    Host(String),
}

impl Access {
    /// Creates the rules of a port: pages of these origins may connect; on a loopback address only loopback names are permitted.
    pub(crate) fn new(origins: Vec<String>, listening_at: SocketAddr) -> Self {
        let hosts = if listening_at.ip().is_loopback() { Hosts::Loopback } else { Hosts::Any };
        Self { origins, hosts }
    }

    /// Checks the headers `Origin` and `Host` of a connection.
    ///
    /// # Errors
    /// [`Forbidden`] with the offending header.
    pub(crate) fn check(&self, origin: Option<&str>, host: Option<&str>) -> Result<(), Forbidden> {
        match (origin, host) {
            (Some(origin), _) if !self.origins.iter().any(|permitted| permitted == origin) => {
                Err(Forbidden::Origin(origin.to_owned()))
            }
            (_, Some(host)) if self.hosts == Hosts::Loopback && !is_loopback(host) => {
                Err(Forbidden::Host(host.to_owned()))
            }
            _ => Ok(()),
        }
    }
}

/// Returns true if a `Host` header, with or without a port, names the loopback interface.
fn is_loopback(host: &str) -> bool {
    if let Ok(address) = host.parse::<SocketAddr>() {
        return address.ip().is_loopback();
    }
    let name = match host.rsplit_once(':') {
        Some((name, port)) if port.bytes().all(|digit| digit.is_ascii_digit()) => name,
        _ => host,
    };
    let address = name.trim_start_matches('[').trim_end_matches(']').parse::<IpAddr>();
    name.eq_ignore_ascii_case("localhost") || address.is_ok_and(|address| address.is_loopback())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn access(listening_at: &str, origins: &[&str]) -> Access {
        let origins = origins.iter().map(|origin| (*origin).to_owned()).collect();
        Access::new(origins, listening_at.parse().expect("it is an address"))
    }

    #[test]
    fn a_web_page_is_refused_unless_its_origin_is_permitted() {
        let closed = access("127.0.0.1:10001", &[]);
        assert_eq!(
            closed.check(Some("http://evil.example"), Some("127.0.0.1:10001")),
            Err(Forbidden::Origin("http://evil.example".to_owned()))
        );
        assert!(closed.check(Some("null"), Some("localhost:10001")).is_err());
        let open = access("127.0.0.1:10001", &["http://localhost:3000"]);
        assert_eq!(open.check(Some("http://localhost:3000"), Some("localhost:10001")), Ok(()));
        assert!(open.check(Some("http://localhost:3001"), Some("localhost:10001")).is_err());
    }

    #[test]
    fn only_names_of_this_machine_reach_a_loopback_port() {
        let closed = access("127.0.0.1:10001", &[]);
        for host in [
            "127.0.0.1",
            "127.0.0.1:10001",
            "localhost",
            "LOCALHOST:1",
            "[::1]:10001",
            "[::1]",
            "127.9.9.9:5",
        ] {
            assert_eq!(closed.check(None, Some(host)), Ok(()), "{host}");
        }
        assert_eq!(closed.check(None, None), Ok(()), "HTTP/1.0 has no Host");
        for host in [
            "rebound.evil.example:10001",
            "localhost.evil.example",
            "192.168.1.7:10001",
            "",
            "127.0.0.1.evil",
        ] {
            assert!(closed.check(None, Some(host)).is_err(), "{host}");
        }
        assert_eq!(access("0.0.0.0:10001", &[]).check(None, Some("laboratory:10001")), Ok(()));
    }
}
