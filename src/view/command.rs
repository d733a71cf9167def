//! Commands of the user and their effects.

/// A command. Positions and distances in the picture are in pixels, x to the right, y down; [`Command::Resize`] sets
/// its size.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Command {
    /// Sets the window's width and height; sides of 0 (a minimised window) are ignored.
    Resize([u32; 2]),
    /// Turns the camera around its target by a drag in pixels.
    Orbit([f32; 2]),
    /// Moves the camera's target by a drag in pixels.
    Pan([f32; 2]),
    /// Moves the camera nearer by notches of the wheel; negative moves it away.
    Zoom(f32),
    Home,
    SelectNext,
    SelectPrevious,
    SelectNone,
    /// Selects the entity that is seen at a position, or none.
    Pick([f32; 2]),
    /// Grabs the selected entity at a position, if it is seen there (see [`Editor::grabs`](super::Editor::grabs)).
    DragStart([f32; 2]),
    /// Moves the grabbed entity in the ground plane to a position.
    DragTo([f32; 2]),
    /// Releases it; one undo reverts the whole drag.
    DragEnd,
    /// Turns an occluder into a light or a light into an occluder.
    ToggleLight,
    /// Reverts the last change of the scene.
    Undo,
    Redo,
    NextScene,
    ToggleRunning,
    ToggleReference,
    ToggleError,
    ToggleOverlay,
    /// Folds or unfolds the list of keys; shows all panels with it where they are hidden.
    ToggleKeys,
    ShowFigures(bool),
    /// Slider: angle of the distant light, degrees.
    SetSkyTurn(f32),
    /// Slider: strength of the distant light.
    SetSky(f32),
    /// Slider: emission in stops; 2^value is the largest channel in W m^-2 sr^-1. It concerns the selected light; if
    /// none is selected, the brightest light, and all others change in proportion.
    SetLight(f32),
    /// Slider: exposure in stops.
    SetExposure(f32),
    /// Ends the movement of a slider, so that one undo reverts all of it.
    EndSlide,
    Screenshot,
    Save,
    Quit,
}

/// Changes by a command, for the viewer to follow. Several may be true, as after an undo.
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
    /// Switches of entities: merge again, after a bake if fields are missing.
    pub roles: bool,
    /// The distant light: update its coefficients and the background, merge again.
    pub sky: bool,
    /// Exposure: draw again.
    pub exposure: bool,
    /// Selection: draw again.
    pub selection: bool,
    /// Overlay, reference, error or running: draw again.
    pub display: bool,
}

impl Changed {
    /// Whether the merged radiosity is out of date.
    pub fn light(&self) -> bool {
        self.scene || self.placements || self.emission || self.roles || self.sky
    }

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
    }
}

#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Effect {
    pub changed: Changed,
    /// One line for the user, if nothing happened or the effect is not visible.
    pub message: Option<String>,
}

impl Effect {
    /// Nothing changed, and a line says why.
    pub(super) fn said(message: impl Into<String>) -> Self {
        Effect { message: Some(message.into()), ..Effect::default() }
    }
}

impl From<Changed> for Effect {
    fn from(changed: Changed) -> Self {
        Effect { changed, ..Effect::default() }
    }
}
