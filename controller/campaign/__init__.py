"""Thousands of closed-loop missions, driven by several policies and judged against an oracle.

command.py - `treadwatch campaign`
own_scenarios.py - scenario files of one's own, beside the families
plan.py - which missions, and on which processes they run
store.py - missions.jsonl, which can be resumed
task.py - one mission with all its policies
stage.py - the mission's world in the plane
view.py - what a camera can see of it
oracle.py - the shortest possible time
noise_mission.py - a drive with simulated perception; noise_model.py, noisy_camera.py, noisy_tracks.py
camera_mission.py - a drive with rendered frames, real perception, driver and emulated base
policies.py - the policies by name
baseline_policy.py, paper_rule.py, zone_monitor.py, protective_field.py, planar_scan.py - the policies to
  compare with
drive_log.py - the log of a drive
contacts.py, contact_fault.py, judge.py - clearance, fault and all other results of a drive
summary.py, figures.py, report.py - the report
stop_and_go_command.py, stop_and_go.py - `treadwatch stop-and-go`: Nav2's bag metrics
"""
