"""Robot models: files, joints, skin, feet, motors, scenery, and the mannequin."""
