//! A device without a window: for the command line, tests and benchmarks. Renderers bring their own.
//!
//! | variable | effect |
//! | --- | --- |
//! | `GNOMON_ADAPTER` | which adapter: its number, or a part of its name (any case), as `llvmpipe` |
//! | `GNOMON_GPU=off` | none at all |
//!
//! Unless told, a real GPU is preferred to a software one. The device has the adapter's own limits and the one
//! feature `TIMESTAMP_QUERY`, where offered; everything works without it.

use std::env;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use super::GpuError;

/// Longer than any frame takes, software GPUs included; a hang must end.
const WAIT_SECONDS: u64 = 300;

/// A device without a window, with its errors as values.
#[derive(Clone, Debug)]
pub struct Gpu {
    /// The device.
    pub device: wgpu::Device,
    /// Its queue.
    pub queue: wgpu::Queue,
    /// What it runs on: for reports.
    pub adapter: wgpu::AdapterInfo,
    /// The first error that no [`Gpu::scoped`] caught, and loss of the device.
    fault: Arc<Mutex<Option<GpuError>>>,
}

impl Gpu {
    /// Opens the adapter that the environment asks for, or the best there is.
    ///
    /// # Errors
    /// [`GpuError::is_missing`] says that there is none.
    pub fn open() -> Result<Self, GpuError> {
        Self::open_asked_for(|_| ())
    }

    /// [`open`](Self::open), with limits that `lower` takes from the adapter's.
    pub(super) fn open_asked_for(lower: impl FnOnce(&mut wgpu::Limits)) -> Result<Self, GpuError> {
        let variable = |name| env::var(name).ok().filter(|value| !value.is_empty());
        if variable("GNOMON_GPU").is_some_and(|value| value.eq_ignore_ascii_case("off")) {
            return Err(GpuError::TurnedOff);
        }
        Self::open_limited(variable("GNOMON_ADAPTER").as_deref(), lower)
    }

    /// Opens the adapter of this number or with this part of its name, whatever the environment says.
    ///
    /// # Errors
    /// As [`Gpu::open`].
    pub fn open_adapter(asked: Option<&str>) -> Result<Self, GpuError> {
        Self::open_limited(asked, |_| ())
    }

    /// [`open_adapter`](Self::open_adapter), with limits that `lower` takes from the adapter's.
    fn open_limited(asked: Option<&str>, lower: impl FnOnce(&mut wgpu::Limits)) -> Result<Self, GpuError> {
        let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle());
        let adapters = pollster::block_on(instance.enumerate_adapters(wgpu::Backends::all()));
        let infos: Vec<_> = adapters.iter().map(wgpu::Adapter::get_info).collect();
        let chosen = choose(&infos, asked)?;
        let info = infos[chosen].clone();
        let adapter = &adapters[chosen];
        let mut limits = adapter.limits();
        lower(&mut limits);
        let descriptor = wgpu::DeviceDescriptor {
            label: Some("gnomon"),
            required_features: adapter.features() & wgpu::Features::TIMESTAMP_QUERY,
            required_limits: limits,
            ..Default::default()
        };
        let (device, queue) = pollster::block_on(adapter.request_device(&descriptor))
            .map_err(|error| GpuError::Device { adapter: info.name.clone(), message: error.to_string() })?;
        let fault = Arc::new(Mutex::new(None));
        let book = |fault: &Mutex<Option<GpuError>>, error: GpuError| {
            // The first fault is the cause, but a loss explains everything.
            let mut fault = fault.lock().unwrap_or_else(PoisonError::into_inner);
            if fault.is_none() || matches!(error, GpuError::Lost { .. }) {
                *fault = Some(error);
            }
        };
        let uncaptured = Arc::clone(&fault);
        device.on_uncaptured_error(Arc::new(move |error: wgpu::Error| {
            book(&uncaptured, GpuError::from_wgpu("GPU work", &error));
        }));
        let lost = Arc::clone(&fault);
        device.set_device_lost_callback(move |reason, message| {
            let message = if message.is_empty() { format!("{reason:?}") } else { message };
            book(&lost, GpuError::Lost { message });
        });
        Ok(Self { device, queue, adapter: info, fault })
    }

    /// Whether the device measures time on its own clock.
    pub fn has_timestamps(&self) -> bool {
        self.device.features().contains(wgpu::Features::TIMESTAMP_QUERY)
    }

    /// The adapter as a report names it: name, backend, driver.
    pub fn adapter_name(&self) -> String {
        let info = &self.adapter;
        let driver = [&info.driver, &info.driver_info].map(|text| text.trim()).join(" ");
        format!("{} ({:?}, {})", info.name, info.backend, driver.trim())
    }

    /// Features in use beyond what every device has, as wgpu names them.
    pub fn features(&self) -> Vec<String> {
        self.device.features().iter_names().map(|(name, _)| name.to_owned()).collect()
    }

    /// Whether it is no GPU but a program that computes as one would, on the CPU.
    pub fn is_software(&self) -> bool {
        self.adapter.device_type == wgpu::DeviceType::Cpu
    }

    /// Fails if the device is lost or something failed outside of [`Gpu::scoped`].
    ///
    /// # Errors
    /// The fault; it stays until the device is dropped.
    pub fn check(&self) -> Result<(), GpuError> {
        self.fault.lock().unwrap_or_else(PoisonError::into_inner).clone().map_or(Ok(()), Err)
    }

    /// Runs `work`, which makes resources or records commands, and turns what the device objects to into an
    /// error that names `what`.
    ///
    /// # Errors
    /// Out of memory, invalid use, a lost device.
    pub fn scoped<T>(&self, what: &str, work: impl FnOnce() -> T) -> Result<T, GpuError> {
        let filters =
            [wgpu::ErrorFilter::Internal, wgpu::ErrorFilter::OutOfMemory, wgpu::ErrorFilter::Validation];
        let scopes = filters.map(|filter| self.device.push_error_scope(filter));
        let result = work();
        let mut fault = None;
        // Scopes close in the reverse order of their opening.
        for scope in scopes.into_iter().rev() {
            if let Some(error) = pollster::block_on(scope.pop()) {
                fault.get_or_insert_with(|| GpuError::from_wgpu(what, &error));
            }
        }
        // What is made on a lost device is invalid, often without a word; the loss itself is told when the device is polled.
        let _ = self.device.poll(wgpu::PollType::Poll);
        self.check()?;
        fault.map_or(Ok(result), Err)
    }

    /// Submits commands and waits for the GPU to finish them.
    ///
    /// # Errors
    /// What went wrong in recording or running them; [`GpuError::Timeout`] after 300 s.
    pub fn submit(&self, encoder: wgpu::CommandEncoder) -> Result<(), GpuError> {
        self.scoped("submitting", || self.queue.submit([encoder.finish()]))?;
        self.wait()
    }

    /// Waits for all submitted work.
    ///
    /// # Errors
    /// A lost device; [`GpuError::Timeout`] after 300 s.
    pub fn wait(&self) -> Result<(), GpuError> {
        let timeout = Some(Duration::from_secs(WAIT_SECONDS));
        let polled = self.device.poll(wgpu::PollType::Wait { submission_index: None, timeout });
        self.check()?;
        polled.map(|_| ()).map_err(|_| GpuError::Timeout { seconds: WAIT_SECONDS })
    }

    /// A command encoder.
    pub fn encoder(&self) -> wgpu::CommandEncoder {
        self.device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("gnomon") })
    }
}

/// Which of these adapters to open.
fn choose(infos: &[wgpu::AdapterInfo], asked: Option<&str>) -> Result<usize, GpuError> {
    if infos.is_empty() {
        return Err(GpuError::NoAdapter);
    }
    let Some(asked) = asked else {
        let rank = |info: &wgpu::AdapterInfo| match info.device_type {
            wgpu::DeviceType::DiscreteGpu => 0,
            wgpu::DeviceType::IntegratedGpu => 1,
            wgpu::DeviceType::VirtualGpu => 2,
            wgpu::DeviceType::Other => 3,
            wgpu::DeviceType::Cpu => 4,
        };
        return Ok((0..infos.len()).min_by_key(|&i| rank(&infos[i])).unwrap_or(0));
    };
    let by_number = asked.parse::<usize>().ok().filter(|&number| number < infos.len());
    let by_name = || {
        let asked = asked.to_lowercase();
        infos.iter().position(|info| info.name.to_lowercase().contains(&asked))
    };
    by_number.or_else(by_name).ok_or_else(|| GpuError::NoSuchAdapter {
        asked: asked.to_owned(),
        known: infos.iter().map(|info| info.name.clone()).collect(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn info(name: &str, device_type: wgpu::DeviceType) -> wgpu::AdapterInfo {
        let mut info = wgpu::AdapterInfo::new(device_type, wgpu::Backend::Vulkan);
        info.name = name.to_owned();
        info
    }

    #[test]
    fn real_gpus_are_preferred() {
        let infos = [
            info("llvmpipe", wgpu::DeviceType::Cpu),
            info("Iris", wgpu::DeviceType::IntegratedGpu),
            info("Radeon 7800", wgpu::DeviceType::DiscreteGpu),
        ];
        assert_eq!(choose(&infos, None), Ok(2));
        assert_eq!(choose(&infos[..2], None), Ok(1));
        assert_eq!(choose(&infos[..1], None), Ok(0));
        assert_eq!(choose(&infos, Some("1")), Ok(1));
        assert_eq!(choose(&infos, Some("LLVM")), Ok(0));
        // A number that is no index may be part of a name.
        assert_eq!(choose(&infos, Some("7800")), Ok(2));
    }

    #[test]
    fn a_missing_adapter_says_what_to_do() {
        let none = choose(&[], Some("0")).unwrap_err();
        assert!(none.is_missing());
        let text = none.to_string();
        for word in ["mesa-vulkan-drivers", "VK_DRIVER_FILES", "GNOMON_GPU=off"] {
            assert!(text.contains(word), "{text}");
        }
        let infos = [info("llvmpipe", wgpu::DeviceType::Cpu)];
        let other = choose(&infos, Some("radeon")).unwrap_err();
        assert!(other.to_string().contains("0: 'llvmpipe'"), "{other}");
    }
}
