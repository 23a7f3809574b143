//! Where defmt logs go: to the debugger by semihosting. With a probe on a real board take
//! `defmt-rtt` instead, which does not stop the processor.

use defmt_semihosting as _;
