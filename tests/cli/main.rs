//! The program as a user runs it: what it writes, what it refuses, and what becomes of its files.

mod bad_input;
mod check;
#[path = "../common/cli.rs"]
mod cli;
#[path = "../common/mod.rs"]
mod common;
mod compare;
mod end_to_end;
mod hostile;
mod kills;
#[path = "../common/model.rs"]
mod model;
mod outputs;
mod profile;
#[path = "../common/room.rs"]
mod room;
mod time_error;
