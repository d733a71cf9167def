//! Recordings that are launched and not waited for: how many, what they keep alive, what the next one sees.

use crate::common;
use common::gpu;
use shadow_fields::gpu::{Access, Buffer, BufferKind, Commands, FLIGHTS};

const BYTES: u64 = 1 << 20;

#[test]
fn at_most_two_are_under_way_and_owners_wait_for_them() {
    let Some(gpu) = gpu() else { return };
    let device = &gpu.device;
    let kept = Buffer::new(device, "kept", BufferKind::Device, BYTES).unwrap();
    let source = Buffer::with_data(device, "source", &vec![7_u32; BYTES as usize / 4]).unwrap();
    let mut flights = std::collections::VecDeque::new();
    for _ in 0..8 {
        if flights.len() == FLIGHTS {
            let timings = Option::unwrap(flights.pop_front().map(shadow_fields::gpu::Flight::wait)).unwrap();
            assert_eq!(timings.len(), 1);
        }
        // Gone at the end of each turn, while its flight may be under way.
        let passing = Buffer::new(device, "passing", BufferKind::Device, BYTES).unwrap();
        let mut commands = Commands::new(device, "flight").unwrap();
        commands.after_flights();
        commands
            .pass("copy", |c| {
                c.copy_range(&source, 0..source.size_bytes, &passing, 0);
                c.barrier(Access::TransferWrite, Access::TransferRead);
                c.copy_range(&passing, 0..passing.size_bytes, &kept, 0);
                Ok(())
            })
            .unwrap();
        flights.push_back(commands.launch().unwrap());
        assert!(device.flight_count() <= FLIGHTS, "{} flights", device.flight_count());
        assert!(device.flight_count() >= 1);
    }
    let commands = Commands::new(device, "third").unwrap();
    let third = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| commands.launch()));
    assert!(third.is_err(), "a third flight beside two was launched");
    drop(flights);
    assert_eq!(device.flight_count(), 0);
    assert!(kept.download::<u32>(BYTES as usize / 4).unwrap().iter().all(|v| *v == 7));
}
