//! TCP port of an emulator, with limits on the users and machines whose programs may connect.

use crate::command_line::warn;
use crate::peer;
use clap::Args;
use rustix::process::geteuid;
use std::io::{self, ErrorKind};
use std::net::{SocketAddr, TcpListener, TcpStream, ToSocketAddrs};
use std::sync::Once;

/// Command line options that admit programs of other users or machines.
#[derive(Args, Clone, Copy, Debug)]
pub struct ReachArguments {
    /// TCP: allow connections of every user of this machine (default: only of your own user and of root); no effect with
    /// --allow-remote, which allows those of every user
    #[arg(long)]
    allow_users: bool,
    /// TCP: permit an address that other machines reach; every program that reaches the port can then command the device
    /// (default: only addresses of this machine)
    #[arg(long)]
    allow_remote: bool,
}

impl ReachArguments {
    /// Returns the widest reach that the options permit.
    #[must_use]
    pub fn reach(self) -> Reach {
        match self {
            Self { allow_remote: true, .. } => Reach::AnyMachine,
            Self { allow_users: true, .. } => Reach::ThisMachine,
            _ => Reach::ThisUser,
        }
    }
}

/// Users and machines whose programs may connect to a port.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reach {
    /// Programs of the user of this process, and of root.
    ThisUser,
    /// Programs of every user of this machine.
    ThisMachine,
    /// Programs of all machines that can reach the address.
    AnyMachine,
}

/// Listening TCP port that admits the connections within its [`Reach`].
#[derive(Debug)]
pub struct Port {
    /// Socket, for `poll`.
    pub(crate) listener: TcpListener,
    reach: Reach,
}

impl Port {
    /// Binds the address `at` (`host:port`) and listens for connections within `reach`.
    ///
    /// # Errors
    /// Errors of the system, or `InvalidInput` for an address that other machines can reach without
    /// [`Reach::AnyMachine`]; both with the remedy.
    pub fn bind(at: &str, reach: Reach) -> io::Result<Self> {
        let unusable = |error: io::Error| {
            let problem = format!("cannot listen at {at}: {error}; 127.0.0.1:0 selects any free port");
            io::Error::new(error.kind(), problem)
        };
        let addresses: Vec<SocketAddr> = at.to_socket_addrs().map_err(unusable)?.collect();
        if reach != Reach::AnyMachine && addresses.iter().any(|address| !address.ip().is_loopback()) {
            let problem = format!(
                "{at} can be reached from other machines, and every program that reaches the address commands the \
                 device; listen at 127.0.0.1, or add --allow-remote (in a scene with the model `ml-api`: `reach = \"any-machine\"`)"
            );
            return Err(io::Error::new(ErrorKind::InvalidInput, problem));
        }
        let listener = TcpListener::bind(&addresses[..]).map_err(unusable)?;
        Ok(Self { listener, reach })
    }

    /// Returns the bound address, with the port number that the system chose for port 0.
    ///
    /// # Errors
    /// Errors of the system.
    pub fn address(&self) -> io::Result<SocketAddr> {
        self.listener.local_addr()
    }

    /// Accepts the next connection within the reach of the port; closes other connections. The first rejection of the
    /// process is reported on standard error.
    ///
    /// # Errors
    /// Errors of the system.
    pub fn accept(&self) -> io::Result<TcpStream> {
        static REFUSAL: Once = Once::new();
        loop {
            let (stream, _) = self.listener.accept()?;
            if self.reach != Reach::ThisUser {
                return Ok(stream);
            }
            let cause = match peer::user(&stream) {
                Ok(user) if user.is_root() || user == geteuid() => return Ok(stream),
                Ok(user) => format!("the connecting program belongs to user {}", user.as_raw()),
                // The client closed the connection at once.
                Err(error) if error.kind() == ErrorKind::NotFound => continue,
                Err(error) => format!("the user of the connecting program is unknown: {error}"),
            };
            REFUSAL.call_once(|| {
                warn(&format!(
                    "a connection was refused: {cause}; --allow-users (in a scene with the model `ml-api`: `reach = \"this-machine\"`) permits connections of every user"
                ))
            });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_address_that_is_taken_is_named_with_the_remedy() {
        let holder = Port::bind("127.0.0.1:0", Reach::ThisUser).unwrap();
        let at = holder.address().unwrap().to_string();
        let error = Port::bind(&at, Reach::ThisUser).unwrap_err().to_string();
        assert!(error.contains(&at) && error.contains("127.0.0.1:0"), "{error}");
    }

    #[test]
    fn other_machines_reach_a_port_with_consent_only() {
        for at in ["0.0.0.0:0", "[::]:0"] {
            for reach in [Reach::ThisUser, Reach::ThisMachine] {
                assert!(Port::bind(at, reach).unwrap_err().to_string().contains("--allow-remote"), "{at}");
            }
        }
        assert!(Port::bind("0.0.0.0:0", Reach::AnyMachine).is_ok());
        assert!(Port::bind("localhost:0", Reach::ThisUser).is_ok());
    }
}
