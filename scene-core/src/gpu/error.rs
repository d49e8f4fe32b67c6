//! Why work on a GPU failed.

use thiserror::Error;

/// Everything that can go wrong with a device. Nothing in [`gpu`](crate::gpu) panics for these.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub enum GpuError {
    /// `GNOMON_GPU=off`.
    #[error("the GPU is turned off by GNOMON_GPU=off")]
    TurnedOff,
    /// No driver offers an adapter.
    #[error(
        "no GPU adapter was found: install a Vulkan driver (on Debian and Ubuntu `mesa-vulkan-drivers`, which \
         has a software one), or point VK_DRIVER_FILES at one; GNOMON_GPU=off goes without"
    )]
    NoAdapter,
    /// There are adapters, but not the one asked for.
    #[error("GNOMON_ADAPTER={asked} matches no adapter: there are {}", list(known))]
    NoSuchAdapter {
        /// What was asked for.
        asked: String,
        /// Names of the adapters there are, in the order of their numbers.
        known: Vec<String>,
    },
    /// The driver refused to make a device.
    #[error("adapter '{adapter}' makes no device: {message}")]
    Device {
        /// The adapter.
        adapter: String,
        /// The driver's reason.
        message: String,
    },
    /// The device is gone: driver reset, GPU unplugged, or destroyed. A new one must be opened.
    #[error("the GPU device was lost: {message}")]
    Lost {
        /// The driver's reason.
        message: String,
    },
    /// Memory ran out.
    #[error("the GPU is out of memory for {what}")]
    OutOfMemory {
        /// What was being made.
        what: String,
    },
    /// A resource is larger than the device allows. [`Gpu`](super::Gpu) asks for all that its adapter offers; a renderer's own
    /// device has WebGPU's 128 MiB unless more was asked for, as `max_storage_buffer_binding_size` and `max_buffer_size`.
    #[error(
        "{what} need {bytes} bytes, but this device binds at most {limit}: take fewer triangles, smaller or fewer \
         maps, or a smaller image, whichever these are, an adapter that binds more (GNOMON_ADAPTER), or the CPU (--backend cpu)"
    )]
    TooLarge {
        /// What.
        what: &'static str,
        /// Its size.
        bytes: u64,
        /// The device's limit.
        limit: u64,
    },
    /// More of something than the device has.
    #[error("{value} {what} are more than this device takes: at most {limit}")]
    Beyond {
        /// What.
        what: &'static str,
        /// How many were asked for.
        value: u32,
        /// The device's limit.
        limit: u32,
    },
    /// The driver or wgpu refused something: a bug of the caller's or of this crate.
    #[error("{what}: {message}")]
    Validation {
        /// What was being done.
        what: String,
        /// The reason.
        message: String,
    },
    /// Work did not finish in time.
    #[error("the GPU did not finish within {seconds} s")]
    Timeout {
        /// The time waited.
        seconds: u64,
    },
}

impl GpuError {
    /// Whether there is no usable GPU at all, rather than one that failed.
    pub fn is_missing(&self) -> bool {
        matches!(self, Self::TurnedOff | Self::NoAdapter | Self::NoSuchAdapter { .. } | Self::Device { .. })
    }

    /// Checks a number against a limit of the device.
    ///
    /// # Errors
    /// [`GpuError::Beyond`].
    pub fn within(what: &'static str, value: u32, limit: u32) -> Result<(), Self> {
        if value > limit { Err(Self::Beyond { what, value, limit }) } else { Ok(()) }
    }

    pub(super) fn from_wgpu(what: &str, error: &wgpu::Error) -> Self {
        match error {
            wgpu::Error::OutOfMemory { .. } => Self::OutOfMemory { what: what.to_owned() },
            wgpu::Error::Validation { description, .. } | wgpu::Error::Internal { description, .. } => {
                Self::Validation { what: what.to_owned(), message: description.clone() }
            }
        }
    }
}

fn list(known: &[String]) -> String {
    let numbered = known.iter().enumerate().map(|(number, name)| format!("{number}: '{name}'"));
    numbered.collect::<Vec<_>>().join(", ")
}
