//! A layer between program and Vulkan in one process: lets a call fail, counts objects, changes what a device claims.

#![allow(unsafe_code)]

use super::calls::{find, vkDeviceWaitIdle};
use super::census::Census;
use super::claimed::Claims;
use super::special::vkGetDeviceProcAddr;
use ash::vk::{self, Handle};
use std::ffi::{CStr, c_char};
use std::sync::{Mutex, MutexGuard, OnceLock, PoisonError};

/// Errors of calls that can fail: of the many that the specification allows, those that happen.
pub const MEMORY: &[vk::Result] = &[vk::Result::ERROR_OUT_OF_DEVICE_MEMORY];
pub const HOST_MEMORY: &[vk::Result] = &[vk::Result::ERROR_OUT_OF_HOST_MEMORY];
pub const LOST: &[vk::Result] = &[vk::Result::ERROR_OUT_OF_DEVICE_MEMORY, vk::Result::ERROR_DEVICE_LOST];

/// A call that can fail, and its errors.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Call {
    pub name: &'static str,
    pub errors: &'static [vk::Result],
}

/// Which call is to fail, counted from 0, and with which of its errors.
#[derive(Clone, Copy, Debug)]
pub struct Plan {
    pub at: usize,
    pub error: usize,
}

#[derive(Debug, Default)]
pub struct Heard {
    pub calls: Vec<Call>,
    /// The call that failed, and its error.
    pub fired: Option<(Call, vk::Result)>,
    pub left: Vec<String>,
    /// What no valid program does: an object destroyed twice, memory mapped that the host cannot see.
    pub wrong: Vec<String>,
}

#[derive(Default)]
pub struct State {
    pub heard: Heard,
    plan: Option<Plan>,
    pub claims: Claims,
    /// Whether the device was lost: all that can tell so does, from then on.
    lost: bool,
    pub census: Census,
    pub instance: vk::Instance,
}

static STATE: OnceLock<Mutex<State>> = OnceLock::new();

pub fn state() -> MutexGuard<'static, State> {
    STATE.get_or_init(Mutex::default).lock().unwrap_or_else(PoisonError::into_inner)
}

/// Runs something and tells what was seen. One watch at a time.
pub fn watch<R>(plan: Option<Plan>, claims: Claims, run: impl FnOnce() -> R) -> (R, Heard) {
    // SAFETY: the function answers with the loader's functions or with wrappers of the same kind, all static.
    unsafe { shadow_fields::gpu::loader::stand_before(instance_address) };
    *state() = State { plan, claims, ..State::default() };
    let outcome = run();
    let mut state = state();
    let mut heard = std::mem::take(&mut state.heard);
    heard.left = state.census.left();
    *state = State::default();
    (outcome, heard)
}

/// Keeps an instance, and with it the drivers, for good: loading them again takes a third of a short run.
pub fn keep_drivers() {
    static KEPT: OnceLock<Option<(ash::Entry, ash::Instance)>> = OnceLock::new();
    // SAFETY: the system's loader is trusted, the structure outlives the call, and the instance is never destroyed.
    KEPT.get_or_init(|| unsafe {
        let entry = ash::Entry::load().ok()?;
        let instance = entry.create_instance(&vk::InstanceCreateInfo::default(), None).ok()?;
        Some((entry, instance))
    });
}

/// Runs something whose words on stdout nobody wants to read.
pub fn without_stdout<R>(run: impl FnOnce() -> R) -> R {
    /// Stdout, to be put back.
    struct Kept(i32);
    impl Drop for Kept {
        fn drop(&mut self) {
            // SAFETY: the descriptor is a copy of stdout that nobody else knows.
            unsafe {
                libc::dup2(self.0, 1);
                libc::close(self.0);
            }
        }
    }
    let nowhere = std::fs::File::options().write(true).open("/dev/null").unwrap();
    // SAFETY: both descriptors are open.
    let _kept = unsafe {
        let kept = Kept(libc::dup(1));
        libc::dup2(std::os::fd::AsRawFd::as_raw_fd(&nowhere), 1);
        kept
    };
    run()
}

/// Notes a call and answers with the error that it is to have, if any.
pub fn fault(name: &'static str, errors: &'static [vk::Result]) -> Option<vk::Result> {
    let (error, devices) = {
        let mut state = state();
        let index = state.heard.calls.len();
        let call = Call { name, errors };
        state.heard.calls.push(call);
        if state.lost && errors.contains(&vk::Result::ERROR_DEVICE_LOST) {
            return Some(vk::Result::ERROR_DEVICE_LOST);
        }
        let plan = state.plan.filter(|plan| plan.at == index)?;
        let error = errors[plan.error % errors.len()];
        state.heard.fired = Some((call, error));
        state.lost = error == vk::Result::ERROR_DEVICE_LOST;
        (error, if state.lost { state.census.devices() } else { Vec::new() })
    };
    // A lost device executes nothing any more.
    for device in devices {
        if let Some(wait) = vkDeviceWaitIdle::REAL.get() {
            // SAFETY: the device is in the census; the program uses one queue on one thread at a time.
            let _ = unsafe { wait(device) };
        }
    }
    Some(error)
}

pub fn born<H: Handle>(handle: H) {
    state().census.born(handle);
}

pub fn dies<H: Handle + Copy>(handle: H) {
    let mut state = state();
    let wrong = state.census.dies(handle);
    state.heard.wrong.extend(wrong);
}

pub type Function = unsafe extern "system" fn();

fn loader() -> vk::PFN_vkGetInstanceProcAddr {
    static ENTRY: OnceLock<ash::Entry> = OnceLock::new();
    // SAFETY: the system's loader is trusted, and is never unloaded.
    ENTRY.get_or_init(|| unsafe { ash::Entry::load() }.expect("a loader")).static_fn().get_instance_proc_addr
}

/// As `vkGetInstanceProcAddr`, with wrappers.
unsafe extern "system" fn instance_address(instance: vk::Instance, name: *const c_char) -> Option<Function> {
    // SAFETY: the caller keeps the contract of this very function.
    let (real, name) = unsafe { (loader()(instance, name)?, CStr::from_ptr(name)) };
    // SAFETY: the name is that of the function.
    unsafe { find(name.to_str().unwrap_or_default(), real) }
}

/// As `vkGetDeviceProcAddr`, with wrappers of the loader's own functions, which serve every device.
pub unsafe extern "system" fn device_address(device: vk::Device, name: *const c_char) -> Option<Function> {
    let instance = state().instance;
    // SAFETY: the caller keeps the contract of this very function, and the device keeps its instance alive.
    let (of_device, of_loader, name) =
        unsafe { (vkGetDeviceProcAddr::real(device, name)?, loader()(instance, name), CStr::from_ptr(name)) };
    // SAFETY: the name is that of the function.
    let wrapped = of_loader.and_then(|real| unsafe { find(name.to_str().unwrap_or_default(), real) });
    wrapped.filter(|wrapped| Some(*wrapped as usize) != of_loader.map(|real| real as usize)).or(Some(of_device))
}

/// A module for each function that is wrapped: the loader's own, and the wrapper, which may fail before all else.
macro_rules! module {
    (
        $name:ident: $pfn:ident($($parameter:ident: $type:ty),*) $(-> $result:ty)? $([$errors:expr])? { $($body:tt)* }
    ) => {
        #[allow(non_snake_case)]
        pub mod $name {
            #[allow(unused_imports)]
            use super::*;
            pub static REAL: OnceLock<vk::$pfn> = OnceLock::new();

            /// # Safety
            /// `real` is the Vulkan function of this name.
            pub unsafe fn wrap(real: Function) -> Function {
                // SAFETY: both are pointers to functions, of the kind that the name says.
                unsafe {
                    REAL.get_or_init(|| std::mem::transmute::<Function, vk::$pfn>(real));
                    std::mem::transmute::<vk::$pfn, Function>(call)
                }
            }

            /// # Safety
            /// That of the Vulkan function.
            pub unsafe fn real($($parameter: $type),*) $(-> $result)? {
                // SAFETY: the caller keeps the contract of this very function.
                unsafe { REAL.get().expect("wrapped")($($parameter),*) }
            }

            /// # Safety
            /// That of the Vulkan function.
            unsafe extern "system" fn call($($parameter: $type),*) $(-> $result)? {
                $(if let Some(error) = fault(stringify!($name), $errors) {
                    return error;
                })?
                // SAFETY: the caller keeps the contract of this very function, which writes what the wrapper reads.
                unsafe { $($body)* }
            }
        }
    };
}
