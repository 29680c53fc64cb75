// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <memory>
#include <mutex>
#include <utility>

namespace kinescope {

/// Values that are made when they are first asked for, and kept. Threads may ask at the same time:
/// one makes a value, others that want the same one wait.
template <typename Key, typename Value>
class Memo {
 public:
  /// The value of `key`, valid as long as the memo. `make()` must not depend on who calls it.
  template <typename Make>
  const Value& get(const Key& key, Make&& make) const {
    Slot& slot = slot_of(key);
    std::call_once(slot.made, [&] { slot.value = std::forward<Make>(make)(); });
    return slot.value;
  }

 private:
  struct Slot {
    std::once_flag made;
    Value value;
  };
  struct State {
    std::mutex mutex;
    std::map<Key, Slot> slots;  // entries stay where they are
  };

  Slot& slot_of(const Key& key) const {
    const std::scoped_lock lock(state_->mutex);
    return state_->slots[key];
  }

  std::unique_ptr<State> state_ = std::make_unique<State>();
};

}  // namespace kinescope
