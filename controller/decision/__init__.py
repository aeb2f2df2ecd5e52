"""Scene, path and state -> Decision: how fast to go now, and why. It begins in decide.py.

The files in the order of one control step, each below the one that asks it:

* decide.py - one control step: checks the input, asks all below, takes the least limit
  * situation.py - the input: newest scene, path, robot pose, speed
  * world_model.py - takes in each new scene with the files below; judges the camera
    * corridor.py - the swept width along the path, and bodies in path coordinates
    * obstacle_boxes.py - makes boxes on the floor of the obstacles
    * bodies.py - these boxes, as arrays
    * view_edges.py - where the camera is; what is below, above or beside its view
    * surfaces.py - the free space as points on the floor
    * known_bodies.py - which bodies count as boxes, in view and out of it
      * turning_vehicles.py - how much nearer the ends of vehicles may swing that turn on the spot
      * known_places.py - which new tracks began where something had stood: no newcomers
      * velocity_filter.py - averages the measured velocities; how fast those who set off may become
      * leaving_movers.py - which of them set off as they leave the view
      * out_of_view.py - keeps bodies that have left the view
        * unseen_motion.py - which of them move, and with which velocity
        * leftover_strips.py - which of them are only the last visible part of another one
        * unseen_position.py - where the movers among them are expected
        * seen_through.py - whether the place of a body that went missing is seen, and seen empty
      * cut_movers.py - how much nearer those may extend that come in over the edge of the view
      * nearer_boxes.py - boxes that may be nearer than they are seen
      * lately_moved.py - which bodies only pause: they moved a moment ago
    * lens_cover.py - whether something covers the lens
    * sight.py - what depth sees of the corridor, and which surfaces in it no body explains
      * blind_corners.py - where somebody may step out
      * held_surface.py - the nearest unexplained surface, also after it has left the view
      * known_floor.py - how far the corridor was seen free
  * limits.py - a speed limit with its reason
  * path_limit.py - top speed, sections and bends, the target
  * camera_limits.py - how far the camera sees, and whether it works
  * speed_limits.py - asks the advisers
    * depth_limits.py - a blind corner, a surface in the corridor, a covered lens, unseen floor
    * standing_limits.py - bodies that stand in the corridor
      * outline.py - in bends, how far beside the corridor a body stands
      * lateral_margin.py - which bodies beside the swept width count as in the way
    * watched.py - the bodies that move, pause or are young: where they will be, which enter the corridor
      * debounce.py - debounced flags for that
    * crossing.py - which are likely to enter; the conflicts with them, and which speeds solve these
    * moving_limits.py - bodies that cross, come towards the robot or drive ahead
    * worst_case_limit.py - what bodies could do at worst
      * manoeuvres.py - how far each may change its velocity
      * reachability.py - what they could reach by that, and where emergency stops end
  * release.py - slower at once, faster after a delay
  * decision.py - the output: action, target speed, reason

Words of this folder:

* Bodies: obstacles as boxes. Young: seen for less than confirm_s. Tracked: for MIN_TRACKED_S or more.
* Remembered: a body out of view that still counts. Boxed: counts as a box; the others as surfaces only.
* Corridor, swept width: the floor that the robot sweeps along its path. Path coordinates: s_m, d_m.
* Surface: a point that depth sees. Explained: it belongs to a body. Band: one bearing of the scan.
* Known: the floor was seen free. Assumed free: floor below the view at the start, taken as free unseen.
* Watched: moves, pauses or is young. Enters: is in the corridor or is likely to come into it. Conflict: the
  time and place of that.
* Innovation: by how much the newest velocity differs from the average beyond noise, counted twice.
* Position uncertainty: of a body out of view; it grows until the body is seen again.
* Limit: a speed not to be exceeded now. Urgent: comfortable braking no longer suffices.
* Clearance: free floor between a body and the corridor (clearance_m). Margin: a distance that is kept.
"""
