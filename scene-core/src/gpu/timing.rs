//! Time per stage on the GPU's own clock, where the device offers timestamps.

use std::fmt;

use crate::Report;

/// Stages of one frame and the queries that time them. A stage is a pass; passes of the same name add up.
pub struct StageTimer {
    queries: wgpu::QuerySet,
    resolved: wgpu::Buffer,
    /// Nanoseconds a tick.
    period: f32,
    stages: Vec<String>,
    capacity: u32,
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
        Some(Self { queries, resolved, period: queue.get_timestamp_period(), stages: Vec::new(), capacity })
    }

    fn begin(&mut self, stage: &str) -> Option<(wgpu::QuerySet, u32)> {
        let index = self.stages.len() as u32;
        if index >= self.capacity {
            return None;
        }
        self.stages.push(stage.to_owned());
        Some((self.queries.clone(), 2 * index))
    }

    /// Records the copy of all times to [`StageTimer::buffer`]. Once a frame, after the last pass.
    pub fn resolve(&self, encoder: &mut wgpu::CommandEncoder) {
        if !self.stages.is_empty() {
            encoder.resolve_query_set(&self.queries, 0..2 * self.stages.len() as u32, &self.resolved, 0);
        }
    }

    /// Start and end of every stage, as u64 ticks; usages `COPY_SRC`.
    pub fn buffer(&self) -> &wgpu::Buffer {
        &self.resolved
    }

    /// Milliseconds per stage from what [`StageTimer::buffer`] held after the frame, and makes ready for the next
    /// frame. A stage whose end lies before its start, as some drivers report now and then, counts 0.
    pub fn take(&mut self, ticks: &[u64]) -> Report {
        let mut report = Report::default();
        for (stage, times) in self.stages.drain(..).zip(ticks.chunks_exact(2)) {
            let ms = times[1].saturating_sub(times[0]) as f64 * f64::from(self.period) * 1e-6;
            *report.stages_ms.entry(stage).or_default() += ms;
        }
        report
    }
}

impl fmt::Debug for StageTimer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("StageTimer").field("stages", &self.stages).field("capacity", &self.capacity).finish()
    }
}

/// Where a technique records: the caller's device, queue and encoder, and a timer if the caller has one.
///
/// Nothing recorded here is submitted, and nothing waits. What the CPU hands over is in buffers that are not written
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

    /// Books a pass under `stage`, named as on the CPU: `prepare.…` or `shade.…`.
    pub fn stage(&mut self, stage: &str) -> StageSpan {
        StageSpan(self.timer.as_mut().and_then(|timer| timer.begin(stage)))
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
