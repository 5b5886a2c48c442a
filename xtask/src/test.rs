//! Every test, in order of speed.
use crate::shell::Result;
pub fn run(_only: &[String]) -> Result<()> { Ok(()) }
pub fn screenshots() -> Result<()> { Ok(()) }
