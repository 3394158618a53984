//! Lookup of the user ID that owns the other end of a local TCP connection, by a netlink query (`sock_diag`,
//! `inet_diag`).
//!
//! ```text
//! request   header 16 bytes | family u8, protocol u8, 2 x 0 | states u32 | socket 48 bytes
//! reply     header 16 bytes | family u8, state u8, 2 x u8   | socket 48 bytes | expires, rqueue, wqueue, user, inode: u32
//! socket    source port, destination port: u16 big-endian | source, destination: 16 bytes | interface u32 | cookie u64
//! ```

use rustix::net::netlink::{SOCK_DIAG, SocketAddrNetlink};
use rustix::net::{AddressFamily, RecvFlags, SendFlags, SocketType, recv, sendto, socket};
use rustix::process::Uid;
use std::io::{self, ErrorKind};
use std::net::{IpAddr, SocketAddr, TcpStream};

/// `SOCK_DIAG_BY_FAMILY`, `NLM_F_REQUEST`, `IPPROTO_TCP`, `AF_INET`, `AF_INET6`.
const BY_FAMILY: u16 = 20;
const REQUEST: u16 = 1;
const TCP: u8 = 6;
const IPV4: u8 = 2;
const IPV6: u8 = 10;
/// Length of a request, bytes.
const QUESTION_BYTES: u32 = 72;
/// Offsets of type, user and inode in a reply, and of the code in an error.
const TYPE_AT: usize = 4;
const ERROR_AT: usize = 16;
const USER_AT: usize = 80;
const INODE_AT: usize = 84;

/// Returns the user ID that owns the other end of a TCP connection within this machine. Not real-time.
///
/// # Errors
/// Errors of the system; `NotFound` if no process of this machine has the other end open.
pub(crate) fn user(stream: &TcpStream) -> io::Result<Uid> {
    let question = question(stream.peer_addr()?, stream.local_addr()?);
    let kernel = socket(AddressFamily::NETLINK, SocketType::RAW, Some(SOCK_DIAG))?;
    sendto(&kernel, &question, SendFlags::empty(), &SocketAddrNetlink::new(0, 0))?;
    let mut answer = [0; 1024];
    let (_, length) = recv(&kernel, &mut answer, RecvFlags::empty())?;
    let answer = answer.get(..length).unwrap_or_default();
    let number = |at: usize| answer.get(at..)?.first_chunk().copied().map(u32::from_ne_bytes);
    let kind = answer.get(TYPE_AT..).and_then(<[u8]>::first_chunk).copied().map(u16::from_ne_bytes);
    match (kind, number(USER_AT), number(INODE_AT)) {
        // A socket that no process has open has inode 0, and user 0 in kernels that drop the user. The kernel reads the user first.
        (Some(BY_FAMILY), Some(user), Some(1..)) => Ok(Uid::from_raw(user)),
        (Some(BY_FAMILY), ..) => Err(ErrorKind::NotFound.into()),
        // An error reply repeats the request after its code.
        _ => Err(io::Error::from_raw_os_error(
            number(ERROR_AT).map_or(0, |code| code.wrapping_neg().cast_signed()),
        )),
    }
}

/// Encodes the request for the socket with these ends.
fn question(source: SocketAddr, destination: SocketAddr) -> Vec<u8> {
    let family = if source.is_ipv4() { IPV4 } else { IPV6 };
    let mut bytes = Vec::with_capacity(QUESTION_BYTES as usize);
    bytes.extend(QUESTION_BYTES.to_ne_bytes());
    bytes.extend(BY_FAMILY.to_ne_bytes());
    bytes.extend(REQUEST.to_ne_bytes());
    bytes.extend([0; 8]);
    bytes.extend([family, TCP, 0, 0]);
    // Sockets in any state.
    bytes.extend([0xff; 4]);
    bytes.extend(source.port().to_be_bytes());
    bytes.extend(destination.port().to_be_bytes());
    for address in [source.ip(), destination.ip()] {
        match address {
            IpAddr::V4(address) => {
                bytes.extend(address.octets());
                bytes.extend([0; 12]);
            }
            IpAddr::V6(address) => bytes.extend(address.octets()),
        }
    }
    // Any interface, no cookie.
    bytes.extend([0; 4]);
    bytes.extend([0xff; 8]);
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::net::TcpListener;

    #[test]
    fn the_user_of_a_connection_is_known_while_its_process_has_it_open() {
        for at in ["127.0.0.1:0", "[::1]:0"] {
            let Ok(listener) = TcpListener::bind(at) else {
                println!("skipped: {at}");
                continue;
            };
            let client = TcpStream::connect(listener.local_addr().unwrap()).unwrap();
            let (server, _) = listener.accept().unwrap();
            assert_eq!(user(&server).unwrap(), rustix::process::getuid(), "{at}");
            drop(client);
            assert_eq!(user(&server).unwrap_err().kind(), ErrorKind::NotFound, "{at}");
        }
    }

    #[test]
    fn a_question_has_the_length_that_it_states() {
        let at = "127.0.0.1:1".parse().unwrap();
        assert_eq!(question(at, at).len(), QUESTION_BYTES as usize);
        let at = "[::1]:1".parse().unwrap();
        assert_eq!(question(at, at).len(), QUESTION_BYTES as usize);
    }
}
