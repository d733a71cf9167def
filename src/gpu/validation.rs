//! The validation layer: the checks that it makes and the messages that it reports.

use crate::error::{Error, Result};
use ash::vk;
use std::ffi::{CStr, c_void};
use std::sync::Mutex;

/// Name of the Khronos layer, as the loader lists it.
pub const LAYER: &CStr = c"VK_LAYER_KHRONOS_validation";

/// How much of the validation layer is switched on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
pub enum Validation {
    /// The layer is not loaded.
    #[default]
    Off,
    /// Usage checks of every call.
    Core,
    /// Usage checks and synchronisation hazards.
    Sync,
    /// Usage checks and GPU-assisted checks of shader accesses.
    Gpu,
}

impl Validation {
    /// Features of `VK_EXT_validation_features` that the mode adds to the layer's usage checks.
    pub(super) fn features(self) -> &'static [vk::ValidationFeatureEnableEXT] {
        match self {
            Validation::Off | Validation::Core => &[],
            Validation::Sync => &[vk::ValidationFeatureEnableEXT::SYNCHRONIZATION_VALIDATION],
            Validation::Gpu => &[
                vk::ValidationFeatureEnableEXT::GPU_ASSISTED,
                vk::ValidationFeatureEnableEXT::GPU_ASSISTED_RESERVE_BINDING_SLOT,
            ],
        }
    }
}

/// Messages reported so far. The debug messenger fills it; it lives as long as the instance.
#[derive(Default)]
pub struct Messages(Mutex<Vec<String>>);

impl Messages {
    /// Messages reported since the last call, oldest first.
    pub fn take(&self) -> Vec<String> {
        std::mem::take(&mut *self.0.lock().unwrap_or_else(|poisoned| poisoned.into_inner()))
    }

    /// An error that quotes every message, if there is any.
    pub fn into_result(messages: Vec<String>) -> Result<()> {
        if messages.is_empty() {
            return Ok(());
        }
        Err(Error::Failed(format!("the validation layer reported {}: {}", messages.len(), messages.join(" | "))))
    }
}

/// The debug messenger's callback: warnings and errors go to the log and into [`Messages`].
///
/// # Safety
/// Called by the loader with valid pointers; `user` is the `Messages` that the messenger was created with, which the
/// instance's owner keeps alive until after the messenger is destroyed.
pub(super) unsafe extern "system" fn on_message(
    severity: vk::DebugUtilsMessageSeverityFlagsEXT,
    _kinds: vk::DebugUtilsMessageTypeFlagsEXT,
    data: *const vk::DebugUtilsMessengerCallbackDataEXT<'_>,
    user: *mut c_void,
) -> vk::Bool32 {
    // SAFETY: see the function's contract.
    let (data, messages) = unsafe { (&*data, &*user.cast::<Messages>()) };
    // SAFETY: a non-null string of the callback data is NUL-terminated and outlives the call.
    let texts = unsafe { [data.message_id_name_as_c_str(), data.message_as_c_str()] };
    let [id, body] = texts.map(|text| text.unwrap_or_default().to_string_lossy());
    if id == "Loader Message" {
        return vk::FALSE;
    }
    if severity.contains(vk::DebugUtilsMessageSeverityFlagsEXT::ERROR) {
        log::error!("validation: {id}: {body}");
    } else {
        log::warn!("validation: {id}: {body}");
    }
    messages.0.lock().unwrap_or_else(|poisoned| poisoned.into_inner()).push(format!("{id}: {body}"));
    vk::FALSE
}
