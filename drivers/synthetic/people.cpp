#include <algorithm>
#include <cmath>

#include "drivers/synthetic/builders.hpp"

namespace stillmap::synthetic {

namespace {

struct Clothes {
  Material shirt, trousers;
  Vec3 skin, hair;
};

Clothes clothes_of(uint32_t look) {
  static const Clothes table[] = {{{Pattern::stripes, {40, 60, 130}, {220, 222, 230}, 0.09f, 1},
                                   {Pattern::cloud, {40, 44, 60}, {70, 76, 100}, 0.05f, 1},
                                   {222, 178, 150},
                                   {60, 42, 30}},
                                  {{Pattern::checks, {160, 40, 44}, {60, 30, 34}, 0.08f, 2},
                                   {Pattern::cloud, {90, 84, 70}, {124, 116, 98}, 0.06f, 2},
                                   {196, 146, 112},
                                   {30, 26, 24}},
                                  {{Pattern::cloud, {60, 120, 76}, {150, 186, 120}, 0.05f, 3},
                                   {Pattern::cloud, {30, 30, 34}, {56, 56, 62}, 0.05f, 3},
                                   {230, 192, 168},
                                   {150, 110, 60}},
                                  {{Pattern::stripes, {210, 150, 50}, {120, 70, 40}, 0.14f, 4},
                                   {Pattern::cloud, {60, 76, 110}, {96, 112, 144}, 0.05f, 4},
                                   {140, 98, 72},
                                   {24, 20, 20}},
                                  {{Pattern::cloud, {176, 172, 166}, {214, 210, 204}, 0.07f, 5},
                                   {Pattern::stripes, {70, 60, 54}, {92, 82, 74}, 0.05f, 5},
                                   {214, 168, 140},
                                   {90, 60, 40}},
                                  {{Pattern::checks, {90, 50, 120}, {170, 130, 190}, 0.12f, 6},
                                   {Pattern::cloud, {46, 60, 52}, {74, 92, 80}, 0.05f, 6},
                                   {224, 184, 160},
                                   {190, 160, 110}}};
  return table[look % 6u];
}

/// Body frame: x forward, y to the left, z up, origin between the feet.
class Body {
 public:
  Body(World& world, const Stance& stance)
      : world_(world), rotation_(yaw_rotation(stance.yaw)), stance_(stance) {}

  Vec3 to_world(Vec3 p_body) const { return rotation_ * p_body + stance_.feet_m; }
  Vec3 to_body(Vec3 p_world) const { return transposed(rotation_) * (p_world - stance_.feet_m); }

  void limb(Vec3 a, Vec3 b, float radius, const Material& material) {
    put(make_capsule(to_world(a), to_world(b), radius, material));
  }
  void lump(Vec3 centre, Vec3 half, const Material& material) {
    put(make_ellipsoid(to_world(centre), half, material, stance_.yaw));
  }

 private:
  void put(Shape shape) {
    shape.moving = true;
    world_.shapes.push_back(shape);
  }

  World& world_;
  Mat3 rotation_;
  Stance stance_;
};

void add_leg(Body& body, float side, float phase, float stride, const Material& trousers) {
  const float hip_angle = 0.06f + 0.48f * stride * std::sin(phase);
  const float bend = 0.08f + 0.75f * stride * std::max(0.0f, std::sin(phase - 0.9f));
  const Vec3 hip = {0.0f, 0.10f * side, 0.92f};
  const Vec3 knee = hip + 0.44f * Vec3{std::sin(hip_angle), 0.0f, -std::cos(hip_angle)};
  const float shin_angle = hip_angle - bend;
  Vec3 ankle = knee + 0.41f * Vec3{std::sin(shin_angle), 0.0f, -std::cos(shin_angle)};
  ankle.z = std::max(ankle.z, 0.07f);
  body.limb(hip, knee, 0.085f, trousers);
  body.limb(knee, ankle, 0.058f, trousers);
  const Material shoe = {Pattern::plain, {44, 36, 32}, {}, 0.1f, 0};
  body.limb(ankle + Vec3{-0.03f, 0, -0.02f}, ankle + Vec3{0.14f, 0, -0.02f}, 0.048f, shoe);
}

void add_arm(Body& body, float side, float phase, const Stance& stance, const Clothes& clothes) {
  const Vec3 shoulder = {0.0f, 0.22f * side, 1.41f};
  const float swing = 0.45f * stance.stride * std::sin(phase);
  Vec3 elbow = shoulder + 0.29f * Vec3{std::sin(swing), 0.16f * side, -std::cos(swing)};
  const float forearm = swing + 0.25f + 0.35f * stance.stride;
  Vec3 hand = elbow + 0.26f * Vec3{std::sin(forearm), 0.0f, -std::cos(forearm)};
  if (stance.grip > 0.0f) {
    // An arm is 0.56 m: a hand farther away stays where the arm can reach.
    Vec3 reach = body.to_body(side > 0 ? stance.left_hand_m : stance.right_hand_m) - shoulder;
    reach = std::min(1.0f, 0.56f / norm(reach)) * reach;
    const Vec3 bent = shoulder + 0.5f * reach + Vec3{-0.03f, 0.09f * side, -0.09f};
    hand = hand + stance.grip * (shoulder + reach - hand);
    elbow = elbow + stance.grip * (bent - elbow);
  }
  const Material skin = {Pattern::plain, clothes.skin, {}, 0.1f, 0};
  body.limb(shoulder, elbow, 0.055f, clothes.shirt);
  body.limb(elbow, hand, 0.043f, clothes.shirt);
  body.lump(hand, {0.05f, 0.045f, 0.06f}, skin);
}

}  // namespace

void add_person(World& world, const Stance& stance, uint32_t look) {
  const Clothes clothes = clothes_of(look);
  constexpr float kHalfTurn = 3.14159265f;
  Stance upright = stance;
  upright.feet_m.z += 0.02f * stance.stride * std::abs(std::sin(stance.phase));
  Body body(world, upright);
  add_leg(body, +1.0f, stance.phase, stance.stride, clothes.trousers);
  add_leg(body, -1.0f, stance.phase + kHalfTurn, stance.stride, clothes.trousers);
  add_arm(body, +1.0f, stance.phase + kHalfTurn, stance, clothes);
  add_arm(body, -1.0f, stance.phase, stance, clothes);
  const Material skin = {Pattern::plain, clothes.skin, {}, 0.1f, 0};
  body.lump({0.0f, 0.0f, 0.95f}, {0.13f, 0.185f, 0.15f}, clothes.trousers);
  body.lump({0.0f, 0.0f, 1.22f}, {0.135f, 0.205f, 0.32f}, clothes.shirt);
  body.limb({0.0f, -0.16f, 1.42f}, {0.0f, 0.16f, 1.42f}, 0.075f, clothes.shirt);
  body.limb({0.0f, 0.0f, 1.46f}, {0.01f, 0.0f, 1.56f}, 0.055f, skin);
  body.lump({0.02f, 0.0f, 1.65f}, {0.10f, 0.08f, 0.125f}, skin);
  body.lump({-0.01f, 0.0f, 1.68f}, {0.105f, 0.09f, 0.115f},
            {Pattern::cloud, clothes.hair, 1.4f * clothes.hair, 0.02f, look});
}

}  // namespace stillmap::synthetic
