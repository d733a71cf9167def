//! What a user can ask for, and what follows from it.

/// A step of an entity, or of all that cast shadows or shine when nothing is selected. Left, right, back and forth are the
/// camera's, in the ground plane; up and down are the world's.
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

/// Something to do. Places in the picture and ways across it are in its pixels, x to the right, y down, as
/// [`Command::Resize`] last said how large it is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Command {
    /// The picture has another size; sides of 0 (a minimised window) are ignored.
    Resize([u32; 2]),
    /// The camera turns around its target by a drag of that many pixels.
    Orbit([f32; 2]),
    /// The target moves by a drag of that many pixels.
    Pan([f32; 2]),
    /// The camera comes nearer by that many notches of a wheel; negative goes farther.
    Zoom(f32),
    /// The whole scene into the picture.
    Home,
    /// The next entity is selected.
    SelectNext,
    /// The previous entity is selected.
    SelectPrevious,
    /// No entity is selected, which means all of them.
    SelectNone,
    /// What is seen at that place is selected; nothing where nothing is.
    Pick([f32; 2]),
    /// One step; `repeat` where a held key says it again, so that one undo takes all of them back.
    Step {
        /// Which way.
        step: Step,
        /// Whether it continues the step before.
        repeat: bool,
    },
    /// The selected entity is grabbed at that place, if it is seen there (see [`Editor::grabs`](super::Editor::grabs)).
    DragStart([f32; 2]),
    /// What was grabbed follows to that place in the ground plane.
    DragTo([f32; 2]),
    /// It is let go: one undo takes the whole drag back.
    DragEnd,
    /// An occluder becomes a light, a light an occluder.
    ToggleLight,
    /// Takes the last change of the scene back; where there is none, the loading of this scene over a changed one.
    Undo,
    /// Does again what was taken back.
    Redo,
    /// Loads the next built-in scene.
    NextScene,
    /// Runs or pauses the motion.
    ToggleRunning,
    /// Shows the ray-cast reference beside the merged picture.
    ToggleReference,
    /// Shows the error in false colour.
    ToggleError,
    /// Shows the overlay.
    ToggleOverlay,
    /// Turns the distant light about +y by an angle, degrees; `repeat` as for steps.
    TurnSky {
        /// Counter-clockwise seen from above.
        by_deg: f32,
        /// Whether it continues the turn before.
        repeat: bool,
    },
    /// Slider: angle of the distant light, degrees.
    SetSkyTurn(f32),
    /// Slider: strength of the distant light; 1 is as the scene has it.
    SetSky(f32),
    /// Slider: emission of the selected light, or of the brightest when none is selected and of all others in proportion, in
    /// stops: 2^value is its largest channel, W m^-2 sr^-1.
    SetLight(f32),
    /// Slider: exposure in stops.
    SetExposure(f32),
    /// A slider is let go: one undo takes all of its movement back.
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

/// What a command changed, for whoever shows it. All may be true at once, as after an undo.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Changed {
    /// Another scene: everything is to be built again.
    pub scene: bool,
    /// Eye, target or size of the picture: draw again.
    pub camera: bool,
    /// Places of entities: merge again.
    pub placements: bool,
    /// Emission of entities: merge again.
    pub emission: bool,
    /// Who emits and who occludes: fields may be missing ([`Editor::needs`](super::Editor::needs)), merge again.
    pub roles: bool,
    /// The distant light: its coefficients, the background, merge again.
    pub sky: bool,
    /// Exposure: draw again.
    pub exposure: bool,
    /// Selection: draw again.
    pub selection: bool,
    /// Overlay, reference, error, running: draw again.
    pub display: bool,
    /// Merge variant.
    pub variant: bool,
}

impl Changed {
    /// Whether the light on vertices is no longer what was merged.
    pub fn light(&self) -> bool {
        self.scene || self.placements || self.emission || self.roles || self.sky
    }

    /// Whether anything is.
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

/// What only the window can do.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Request {
    /// Write the picture as PNG and EXR.
    Screenshot,
    /// Call [`Editor::save`](super::Editor::save).
    Save,
    /// Close.
    Quit,
}

/// What follows from a command.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Effect {
    /// What changed.
    pub changed: Changed,
    /// What is to be done besides.
    pub request: Option<Request>,
    /// One line for the user: why nothing happened, or what did that cannot be seen.
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
