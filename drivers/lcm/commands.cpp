#include "drivers/lcm/codec.hpp"
#include "drivers/lcm/lcm.hpp"
#include "drivers/lcm/listener.hpp"
#include "runtime/core/bounded_queue.hpp"

namespace stillmap {
namespace {

constexpr uint32_t kWaitingCommands = 16;

class LcmCommands final : public CommandPort {
 public:
  Status next(CommandMessage& command) override {
    return waiting_.pop(command) ? Status::ok : Status::timeout;
  }
  uint32_t refused() const override { return refused_.load(std::memory_order_relaxed); }

  Result<Done> open(const std::string& url) {
    auto listener = LcmListener::open(
        url, [this](std::string_view channel, View<const uint8_t> payload) { hear(channel, payload); });
    if (!listener) return Error{listener.error(), listener.error_kind()};
    listener_ = std::move(*listener);
    return Done{};
  }

 private:
  void hear(std::string_view channel, View<const uint8_t> payload) {
    if (channel != kCommandChannel) return;
    CommandMessage command;
    if (codec_.decode(payload, command) != Status::ok || !waiting_.push(command))
      refused_.fetch_add(1, std::memory_order_relaxed);
  }

  LcmCodec codec_;
  BoundedQueue<CommandMessage> waiting_{kWaitingCommands};
  std::atomic<uint32_t> refused_{0};
  std::unique_ptr<LcmListener> listener_;  ///< last: its thread uses all the others
};

}  // namespace

Result<std::unique_ptr<CommandPort>> open_lcm_commands(const std::string& url) {
  auto commands = std::make_unique<LcmCommands>();
  if (const auto opened = commands->open(url); !opened) return Error{opened.error(), opened.error_kind()};
  return std::unique_ptr<CommandPort>(std::move(commands));
}

}  // namespace stillmap
