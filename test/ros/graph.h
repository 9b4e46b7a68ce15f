// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <ros/node_handle.h>
#include <ros/service.h>

#include <chrono>
#include <condition_variable>
#include <functional>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

namespace nerf_pose_refiner {

/// How long a test waits for what must come, by the wall clock: long, for machines that are busy.
constexpr std::chrono::seconds kPatience(30);

/// Waits until `holds`, asking now and then. @return whether it came to hold.
bool waitUntil(const std::function<bool()>& holds);

/// The messages of a topic, in order.
template <typename Message>
class Listener {
 public:
  Listener(ros::NodeHandle nh, const std::string& topic)
      : subscriber_(nh.subscribe(topic, 1000, &Listener::onMessage, this)) {}

  bool connected() const { return subscriber_.getNumPublishers() > 0; }

  void clear() {
    std::lock_guard<std::mutex> lock(mutex_);
    messages_.clear();
  }

  std::vector<Message> all() const {
    std::lock_guard<std::mutex> lock(mutex_);
    return messages_;
  }

  /// The newest message, also from before `clear`.
  std::optional<Message> last() const {
    std::lock_guard<std::mutex> lock(mutex_);
    return last_;
  }

  /// The first message since `clear` that fulfils the condition; waits for it.
  std::optional<Message> wait(const std::function<bool(const Message&)>& condition) {
    const auto deadline = std::chrono::steady_clock::now() + kPatience;
    std::unique_lock<std::mutex> lock(mutex_);
    std::size_t looked_at = 0;
    while (true) {
      for (; looked_at < messages_.size(); ++looked_at) {
        if (condition(messages_[looked_at])) return messages_[looked_at];
      }
      if (changed_.wait_until(lock, deadline) == std::cv_status::timeout) return std::nullopt;
    }
  }

  std::optional<Message> wait() {
    return wait([](const Message&) { return true; });
  }

 private:
  void onMessage(const boost::shared_ptr<const Message>& message) {
    {
      std::lock_guard<std::mutex> lock(mutex_);
      messages_.push_back(*message);
      last_ = *message;
    }
    changed_.notify_all();
  }

  mutable std::mutex mutex_;  ///< guards messages_ and last_
  std::condition_variable changed_;
  std::vector<Message> messages_;
  std::optional<Message> last_;
  ros::Subscriber subscriber_;  ///< last: it calls back
};

}  // namespace nerf_pose_refiner
