#pragma once

// Short words to furnish a World with.

#include "drivers/synthetic/scene.hpp"

namespace stillmap::synthetic {

/// Rotation about z by `yaw` radians.
Mat3 yaw_rotation(float yaw);

Shape make_box(Vec3 centre_m, Vec3 half_m, const Material& material, float yaw = 0);
Shape make_ellipsoid(Vec3 centre_m, Vec3 half_m, const Material& material, float yaw = 0);
/// Capsule whose axis ends at `a` and `b`.
Shape make_capsule(Vec3 a_m, Vec3 b_m, float radius_m, const Material& material);
/// Box between two opposite corners, axes along the world's.
Shape make_block(Vec3 low_m, Vec3 high_m, const Material& material);

/// About 5 x 4 x 2.6 m, textured, furniture along the walls; |x| < 1.5, |y| < 1.1 is free for camera and
/// people.
void furnished_room(World& world);
/// Of the same size: painted walls with hardly any texture, four plain boxes.
void bare_room(World& world);
/// Eight furnished rooms of 5 x 4 m in two rows, 20 x 8 m together, joined to a ring by doors 1.1 m wide.
void suite_of_rooms(World& world);
/// 14 x 9 x 4.5 m, the camera at its west end: but for some floor, boxes and two columns all is out of its
/// range.
void hall(World& world);
/// 66 m along x, 2.4 m wide, no two stretches alike; |y| < 0.65 is free for the camera.
void corridor(World& world);

/// Where a person is. The body is about 1.75 m tall, 0.55 m wide, and reaches 0.3 m to the front when
/// walking.
struct Stance {
  Vec3 feet_m;       ///< between the feet, on the floor
  float yaw = 0;     ///< radians, where the body faces
  float stride = 0;  ///< 0 standing, 1 a fast walk
  float phase = 0;   ///< radians, of the walk cycle
  float grip = 0;    ///< 0: the arms swing; 1: the hands are at `left_hand_m` and `right_hand_m`
  Vec3 left_hand_m, right_hand_m;
};

/// Adds the limbs and clothes of a person, all moving.
/// @param look 0..5, which clothes
void add_person(World& world, const Stance& stance, uint32_t look);

}  // namespace stillmap::synthetic
