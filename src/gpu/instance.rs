//! The Vulkan instance: the program's own, with what the loader must have for it, or one that belongs to a caller.

use super::select::version_text;
use super::validation::{LAYER, Messages, Validation, on_message};
use super::{Checked, loader};
use crate::error::{Error, Result};
use ash::vk;
use std::ffi::CStr;
use std::sync::Arc;

/// Instance-level objects; dropped after the logical device.
pub(super) struct Instance {
    pub(super) handle: ash::Instance,
    /// `None` where the instance belongs to a caller.
    pub(super) own: Option<OwnInstance>,
    /// Shared, with an address that stays: the messenger holds it.
    pub(super) messages: Arc<Messages>,
}

/// An instance that this library destroys, with its debug messenger.
pub(super) struct OwnInstance {
    pub(super) entry: ash::Entry,
    debug: Option<(ash::ext::debug_utils::Instance, vk::DebugUtilsMessengerEXT)>,
    /// Whether objects can have names.
    pub(super) has_debug_utils: bool,
}

/// Checks that the loader has Vulkan 1.3, the validation layer if it is asked for, and the extensions in `surface`,
/// which a window needs. Answers whether the loader has debug utils, which name objects in captures.
fn check_loader(entry: &ash::Entry, validation: Validation, surface: &[&'static CStr]) -> Result<bool> {
    // SAFETY: this and the two enumerations below are plain queries on a live entry.
    let version = unsafe { entry.try_enumerate_instance_version() }
        .checked("vkEnumerateInstanceVersion", "instance")?
        .unwrap_or(vk::API_VERSION_1_0);
    if version < vk::API_VERSION_1_3 {
        return Err(Error::Unsupported(format!(
            "the Vulkan loader supports version {}, but 1.3 is needed",
            version_text(version)
        )));
    }
    // SAFETY: as above.
    let layers = unsafe { entry.enumerate_instance_layer_properties() }
        .checked("vkEnumerateInstanceLayerProperties", "instance")?;
    let has_layer = layers.iter().any(|l| l.layer_name_as_c_str() == Ok(LAYER));
    if validation != Validation::Off && !has_layer {
        return Err(Error::Unsupported(
            "the Khronos validation layer is not installed (Debian's package is vulkan-validationlayers)".into(),
        ));
    }
    // SAFETY: as above.
    let extensions = match unsafe { entry.enumerate_instance_extension_properties(None) } {
        // What the loader returns where a driver's description is no JSON.
        Err(vk::Result::ERROR_OUT_OF_HOST_MEMORY) => return Err(loader::no_driver()),
        other => other.checked("vkEnumerateInstanceExtensionProperties", "instance")?,
    };
    let has = |name: &CStr| extensions.iter().any(|e| e.extension_name_as_c_str() == Ok(name));
    if let Some(missing) = surface.iter().find(|name| !has(name)) {
        let missing = missing.to_string_lossy();
        return Err(Error::Unsupported(format!(
            "the Vulkan driver opens no windows here (it lacks {missing}); `shadow-fields render` needs none"
        )));
    }
    Ok(has(ash::ext::debug_utils::NAME))
}

impl Instance {
    /// One of a caller, who destroys it later than everything that is made here.
    pub(super) fn borrowed(handle: ash::Instance) -> Self {
        Instance { handle, own: None, messages: Arc::default() }
    }

    /// `surface` lists the extensions that a window needs.
    pub(super) fn new(validation: Validation, surface: &[&'static CStr]) -> Result<Self> {
        let entry = loader::entry()?;
        let has_debug_utils = check_loader(&entry, validation, surface)?;
        let application = vk::ApplicationInfo::default()
            .application_name(c"shadow-fields")
            .engine_name(c"shadow-fields")
            .api_version(vk::API_VERSION_1_3);
        let mut layer_names = Vec::new();
        let mut extension_names: Vec<_> = surface.iter().map(|name| name.as_ptr()).collect();
        if has_debug_utils {
            extension_names.push(ash::ext::debug_utils::NAME.as_ptr());
        }
        if validation != Validation::Off {
            layer_names.push(LAYER.as_ptr());
            extension_names.push(ash::ext::validation_features::NAME.as_ptr());
        }
        let mut features = vk::ValidationFeaturesEXT::default().enabled_validation_features(validation.features());
        let mut create = vk::InstanceCreateInfo::default()
            .application_info(&application)
            .enabled_layer_names(&layer_names)
            .enabled_extension_names(&extension_names);
        if validation != Validation::Off {
            create = create.push_next(&mut features);
        }
        // SAFETY: every pointer in `create` outlives the call; the handle is destroyed in `Drop` after its children.
        let handle = match unsafe { entry.create_instance(&create, None) } {
            // The loader returns this code when it finds no driver.
            Err(vk::Result::ERROR_INCOMPATIBLE_DRIVER) => return Err(loader::no_driver()),
            other => other.checked("vkCreateInstance", "instance")?,
        };
        let own = OwnInstance { entry, debug: None, has_debug_utils };
        let mut instance = Instance { handle, own: Some(own), messages: Arc::default() };
        if validation != Validation::Off {
            instance.listen()?;
        }
        Ok(instance)
    }

    fn listen(&mut self) -> Result<()> {
        let Some(own) = &mut self.own else { return Ok(()) };
        let loader = ash::ext::debug_utils::Instance::new(&own.entry, &self.handle);
        let create = vk::DebugUtilsMessengerCreateInfoEXT::default()
            .message_severity(
                vk::DebugUtilsMessageSeverityFlagsEXT::WARNING | vk::DebugUtilsMessageSeverityFlagsEXT::ERROR,
            )
            .message_type(
                vk::DebugUtilsMessageTypeFlagsEXT::GENERAL
                    | vk::DebugUtilsMessageTypeFlagsEXT::VALIDATION
                    | vk::DebugUtilsMessageTypeFlagsEXT::PERFORMANCE,
            )
            .pfn_user_callback(Some(on_message))
            .user_data((&raw const *self.messages).cast_mut().cast());
        // SAFETY: `messages` does not move and is dropped after the messenger (see `Drop`).
        let messenger = unsafe { loader.create_debug_utils_messenger(&create, None) }
            .checked("vkCreateDebugUtilsMessengerEXT", "instance")?;
        own.debug = Some((loader, messenger));
        Ok(())
    }
}

impl Drop for Instance {
    fn drop(&mut self) {
        let Some(own) = &self.own else { return };
        // SAFETY: the logical device was dropped before (field order of `Device`); the messenger goes before its
        // instance.
        unsafe {
            if let Some((loader, messenger)) = &own.debug {
                loader.destroy_debug_utils_messenger(*messenger, None);
            }
            self.handle.destroy_instance(None);
        }
    }
}
