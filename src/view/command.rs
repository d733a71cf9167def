//! Commands of the user and their effects.

/// A step of the selected entity, or of all entities that occlude or emit if none is selected. Left, right, back and forth are
/// relative to the camera, in the ground plane; up and down are the world's.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Step {
    /// To the left of the picture.
    Left,
    /// To the right of the picture.
    Right,
    /// Towards +y.
    Up,
    /// Towards -y.
    Down,
    /// Away from the camera.
    Forth,
    /// Towards the camera.
    Back,
    /// Larger about its origin.
    Larger,
    /// Smaller about its origin.
    Smaller,
    /// Turned about +y through its origin, counter-clockwise seen from above.
    TurnLeft,
    /// Turned about +y through its origin, clockwise seen from above.
    TurnRight,
}

/// A command. Positions and distances in the picture are in pixels, x to the right, y down; [`Command::Resize`] sets its size.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Command {
    /// Sets the picture's width and height; sides of 0 (a minimised window) are ignored.
    Resize([u32; 2]),
    /// Turns the camera around its target by a drag in pixels.
    Orbit([f32; 2]),
    /// Moves the camera's target by a drag in pixels.
    Pan([f32; 2]),
    /// Moves the camera nearer by notches of the wheel; negative moves it away.
    Zoom(f32),
    /// Shows the whole scene.
    Home,
    /// Selects the next entity.
    SelectNext,
    /// Selects the previous entity.
    SelectPrevious,
    /// Selects no entity; steps then move all that occlude or emit.
    SelectNone,
    /// Selects the entity that is seen at a position, or none.
    Pick([f32; 2]),
    /// Makes one step. `repeat` says that a held key repeats it, so that one undo reverts all of these steps.
    Step {
        /// Kind of step.
        step: Step,
        /// Whether it continues the previous step.
        repeat: bool,
    },
    /// Grabs the selected entity at a position, if it is seen there (see [`Editor::grabs`](super::Editor::grabs)).
    DragStart([f32; 2]),
    /// Moves the grabbed entity in the ground plane to a position.
    DragTo([f32; 2]),
    /// Releases it; one undo reverts the whole drag.
    DragEnd,
    /// Turns an occluder into a light or a light into an occluder.
    ToggleLight,
    /// Reverts the last change of the scene; if there is none, returns to the changed scene that this one replaced.
    Undo,
    /// Repeats the change that was undone last.
    Redo,
    /// Loads the next built-in scene.
    NextScene,
    /// Runs or pauses the motion.
    ToggleRunning,
    /// Shows the ray-cast reference beside the merged picture.
    ToggleReference,
    /// Shows the error in false colour.
    ToggleError,
    /// Shows or hides the overlay.
    ToggleOverlay,
    /// Folds or unfolds the list of keys.
    ToggleKeys,
    /// Turns the distant light about +y.
    TurnSky {
        /// Angle in degrees, counter-clockwise seen from above.
        by_deg: f32,
        /// Whether it continues the previous turn.
        repeat: bool,
    },
    /// Slider: angle of the distant light, degrees.
    SetSkyTurn(f32),
    /// Slider: strength of the distant light.
    SetSky(f32),
    /// Slider: emission in stops; 2^value is the largest channel in W m^-2 sr^-1. It concerns the selected light; if none is
    /// selected, the brightest light, and all others change in proportion.
    SetLight(f32),
    /// Slider: exposure in stops.
    SetExposure(f32),
    /// Ends the movement of a slider, so that one undo reverts all of it.
    EndSlide,
    /// Merge variant by name (see [`crate::merge::variant::VARIANTS`]); `None` is the device's fastest.
    SetVariant(Option<&'static str>),
    /// Writes the picture as PNG and EXR.
    Screenshot,
    /// Writes the scene as TOML.
    Save,
    /// Closes the window.
    Quit,
}

/// What a command changed, so that the viewer knows what to update. Several may be true, as after an undo.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Changed {
    /// Another scene: rebuild everything.
    pub scene: bool,
    /// Eye, target or size of the picture: draw again.
    pub camera: bool,
    /// Placements of entities: merge again.
    pub placements: bool,
    /// Emission of entities: merge again.
    pub emission: bool,
    /// Switches of entities: merge again, after a bake if fields are missing ([`Editor::needs`](super::Editor::needs)).
    pub roles: bool,
    /// The distant light: update its coefficients and the background, merge again.
    pub sky: bool,
    /// Exposure: draw again.
    pub exposure: bool,
    /// Selection: draw again.
    pub selection: bool,
    /// Overlay, reference, error or running: draw again.
    pub display: bool,
    /// Merge variant: merge again.
    pub variant: bool,
}

impl Changed {
    /// Whether the merged radiosity is out of date.
    pub fn light(&self) -> bool {
        self.scene || self.placements || self.emission || self.roles || self.sky
    }

    /// Whether anything changed.
    pub fn any(&self) -> bool {
        *self != Changed::default()
    }
}

impl std::ops::BitOrAssign for Changed {
    fn bitor_assign(&mut self, other: Self) {
        self.scene |= other.scene;
        self.camera |= other.camera;
        self.placements |= other.placements;
        self.emission |= other.emission;
        self.roles |= other.roles;
        self.sky |= other.sky;
        self.exposure |= other.exposure;
        self.selection |= other.selection;
        self.display |= other.display;
        self.variant |= other.variant;
    }
}

/// A request that only the window can fulfil.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Request {
    /// Write the picture as PNG and EXR.
    Screenshot,
    /// Call [`Editor::save`](super::Editor::save).
    Save,
    /// Fold or unfold the list of keys.
    ToggleKeys,
    /// Close the window.
    Quit,
}

/// The effect of a command.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Effect {
    /// What changed.
    pub changed: Changed,
    /// What else the window must do.
    pub request: Option<Request>,
    /// One line for the user, if nothing happened or the effect is not visible.
    pub message: Option<String>,
}

impl From<Changed> for Effect {
    fn from(changed: Changed) -> Self {
        Effect { changed, ..Effect::default() }
    }
}

impl From<Request> for Effect {
    fn from(request: Request) -> Self {
        Effect { request: Some(request), ..Effect::default() }
    }
}
