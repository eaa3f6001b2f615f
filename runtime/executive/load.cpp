#include "runtime/executive/load.hpp"

#include <algorithm>

namespace stillmap {

void LoadShedder::add(double total_ms, bool integrated, double period_ms) {
  if (period_ms <= 0) return;
  ms_[frame_ % kWindow] = static_cast<float>(total_ms);
  integrated_[frame_ % kWindow] = integrated;
  ++frame_;
  in_window_ = std::min(in_window_ + 1, kWindow);
  ++since_change_;
  if (in_window_ < kWindow) return;

  if (mean_ms() > kTooMuch * period_ms) {
    if (shed_ == Shed::finest_level) return;  // there is no more to leave out: the newest frame wins
    // A return that did not hold waits longer the next time.
    if (returned_ && since_change_ < 2 * patience_) patience_ = std::min(2 * patience_, kMostPatience);
    change(shed_ == Shed::nothing ? Shed::every_second_integration : Shed::finest_level);
    returned_ = false;
    return;
  }
  if (shed_ == Shed::nothing) {
    if (since_change_ > 2 * patience_) patience_ = kPatience;
    return;
  }
  if (since_change_ < patience_) return;
  const double expected_ms = shed_ == Shed::finest_level ? kFinestShare * mean_ms() : mean_whole_ms();
  if (expected_ms > kRoom * period_ms) return;
  change(shed_ == Shed::finest_level ? Shed::every_second_integration : Shed::nothing);
  returned_ = true;
}

double LoadShedder::mean_ms() const {
  double sum = 0;
  for (const float ms : ms_) sum += static_cast<double>(ms);
  return sum / kWindow;
}

/// Of the frames that were mapped as well.
double LoadShedder::mean_whole_ms() const {
  double sum = 0;
  uint32_t count = 0;
  for (uint32_t i = 0; i < kWindow; ++i) {
    if (!integrated_[i]) continue;
    sum += static_cast<double>(ms_[i]);
    ++count;
  }
  return count == 0 ? mean_ms() : sum / count;
}

void LoadShedder::change(Shed to) {
  shed_ = to;
  in_window_ = 0;
  since_change_ = 0;
}

}  // namespace stillmap
