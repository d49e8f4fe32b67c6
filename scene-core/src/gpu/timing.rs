//! Time per stage: on the GPU's own clock, where the device offers timestamps, or on that on the wall.

use std::time::Instant;
use std::{fmt, mem};

use crate::Report;

/// Times the stages of one frame. A stage is a pass; passes of the same name add up.
#[derive(Debug)]
pub struct StageTimer(Clock);

#[derive(Debug)]
enum Clock {
    Device(DeviceClock),
    Wall(WallClock),
}

/// Stages and the queries that time them.
struct DeviceClock {
    queries: wgpu::QuerySet,
    resolved: wgpu::Buffer,
    /// Nanoseconds a tick.
    period: f32,
    stages: Vec<String>,
    capacity: u32,
}

/// The stage that is being recorded, and the times of those before it.
#[derive(Debug, Default)]
struct WallClock {
    current: Option<(String, Instant)>,
    report: Report,
}

impl StageTimer {
    /// A timer of up to `stages` passes (at most 2048, what a query set holds); `None` if the device has no
    /// `TIMESTAMP_QUERY`. Passes beyond are not timed.
    pub fn new(device: &wgpu::Device, queue: &wgpu::Queue, stages: u32) -> Option<Self> {
        if !device.features().contains(wgpu::Features::TIMESTAMP_QUERY) {
            return None;
        }
        let capacity = stages.clamp(1, wgpu::QUERY_SET_MAX_QUERIES / 2);
        let queries = device.create_query_set(&wgpu::QuerySetDescriptor {
            label: Some("stages"),
            ty: wgpu::QueryType::Timestamp,
            count: 2 * capacity,
        });
        let resolved = device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("stage times"),
            size: u64::from(2 * capacity) * 8,
            usage: wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC,
            mapped_at_creation: false,
        });
        let period = queue.get_timestamp_period();
        Some(Self(Clock::Device(DeviceClock { queries, resolved, period, stages: Vec::new(), capacity })))
    }

    /// A timer that submits what a stage recorded and waits for it before the next one begins.
    ///
    /// For GPUs in software: Mesa's takes both timestamps of a compute pass after its work, and books that work nowhere. A real GPU
    /// would idle between the stages.
    pub fn on_the_wall() -> Self {
        Self(Clock::Wall(WallClock::default()))
    }

    /// Records the copy of all times to [`StageTimer::buffer`]. Once a frame, after the last pass.
    pub fn resolve(&self, encoder: &mut wgpu::CommandEncoder) {
        let Clock::Device(clock) = &self.0 else { return };
        if !clock.stages.is_empty() {
            encoder.resolve_query_set(&clock.queries, 0..2 * clock.stages.len() as u32, &clock.resolved, 0);
        }
    }

    /// Start and end of every stage, as u64 ticks; usages `COPY_SRC`. `None` on the wall.
    pub fn buffer(&self) -> Option<&wgpu::Buffer> {
        match &self.0 {
            Clock::Device(clock) => Some(&clock.resolved),
            Clock::Wall(_) => None,
        }
    }

    /// Milliseconds per stage from what [`StageTimer::buffer`] held after the frame, and makes ready for the next
    /// frame. A stage whose end lies before its start, as some drivers report now and then, counts 0. Of a timer on the wall the
    /// last stage ends here: call it when the frame's work is done.
    pub fn take(&mut self, ticks: &[u64]) -> Report {
        match &mut self.0 {
            Clock::Device(clock) => clock.take(ticks),
            Clock::Wall(clock) => {
                clock.end();
                mem::take(&mut clock.report)
            }
        }
    }
}

impl DeviceClock {
    fn begin(&mut self, stage: &str) -> Option<(wgpu::QuerySet, u32)> {
        let index = self.stages.len() as u32;
        if index >= self.capacity {
            return None;
        }
        self.stages.push(stage.to_owned());
        Some((self.queries.clone(), 2 * index))
    }

    fn take(&mut self, ticks: &[u64]) -> Report {
        let mut report = Report::default();
        for (stage, times) in self.stages.drain(..).zip(ticks.chunks_exact(2)) {
            let ms = times[1].saturating_sub(times[0]) as f64 * f64::from(self.period) * 1e-6;
            *report.stages_ms.entry(stage).or_default() += ms;
        }
        report
    }
}

impl WallClock {
    fn is_in(&self, stage: &str) -> bool {
        self.current.as_ref().is_some_and(|(current, _)| current == stage)
    }

    fn begin(&mut self, stage: &str) {
        self.end();
        self.current = Some((stage.to_owned(), Instant::now()));
    }

    fn end(&mut self) {
        if let Some((stage, start)) = self.current.take() {
            *self.report.stages_ms.entry(stage).or_default() += start.elapsed().as_secs_f64() * 1e3;
        }
    }
}

impl fmt::Debug for DeviceClock {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("DeviceClock")
            .field("stages", &self.stages)
            .field("capacity", &self.capacity)
            .finish_non_exhaustive()
    }
}

/// Where a technique records: the caller's device, queue and encoder, and a timer if the caller has one.
///
/// Nothing recorded here is submitted, and nothing waits, but for a timer [on the wall](StageTimer::on_the_wall). What the CPU hands over is in buffers that are not written
/// again ([`HeldBuffer`](super::HeldBuffer)), so that any number of calls may share one encoder.
#[derive(Debug)]
pub struct Recorder<'a> {
    /// The device.
    pub device: &'a wgpu::Device,
    /// Its queue, for uploads that come before the encoder's commands.
    pub queue: &'a wgpu::Queue,
    /// Where commands go.
    pub encoder: &'a mut wgpu::CommandEncoder,
    /// Measures passes, where wanted and offered.
    pub timer: Option<&'a mut StageTimer>,
}

impl<'a> Recorder<'a> {
    /// A recorder without a timer.
    pub fn new(
        device: &'a wgpu::Device,
        queue: &'a wgpu::Queue,
        encoder: &'a mut wgpu::CommandEncoder,
    ) -> Self {
        Self { device, queue, encoder, timer: None }
    }

    /// Books the pass that is recorded next under `stage`, named as on the CPU: `prepare.…` or `shade.…`.
    pub fn stage(&mut self, stage: &str) -> StageSpan {
        let Some(StageTimer(clock)) = self.timer.as_deref_mut() else { return StageSpan(None) };
        match clock {
            Clock::Device(clock) => StageSpan(clock.begin(stage)),
            Clock::Wall(clock) if clock.is_in(stage) => StageSpan(None),
            Clock::Wall(clock) => {
                let next = self.device.create_command_encoder(&Default::default());
                self.queue.submit([mem::replace(self.encoder, next).finish()]);
                // A lost device is told where the frame is submitted.
                let _ = self.device.poll(wgpu::PollType::wait_indefinitely());
                clock.begin(stage);
                StageSpan(None)
            }
        }
    }
}

/// The queries of one pass; empty where nothing is timed.
#[derive(Clone, Debug)]
pub struct StageSpan(Option<(wgpu::QuerySet, u32)>);

impl StageSpan {
    /// For a render pass's descriptor.
    pub fn render(&self) -> Option<wgpu::RenderPassTimestampWrites<'_>> {
        self.0.as_ref().map(|(query_set, first)| wgpu::RenderPassTimestampWrites {
            query_set,
            beginning_of_pass_write_index: Some(*first),
            end_of_pass_write_index: Some(first + 1),
        })
    }

    /// For a compute pass's descriptor.
    pub fn compute(&self) -> Option<wgpu::ComputePassTimestampWrites<'_>> {
        self.0.as_ref().map(|(query_set, first)| wgpu::ComputePassTimestampWrites {
            query_set,
            beginning_of_pass_write_index: Some(*first),
            end_of_pass_write_index: Some(first + 1),
        })
    }
}
