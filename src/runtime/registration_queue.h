// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <condition_variable>
#include <cstdint>
#include <functional>
#include <list>
#include <memory>
#include <mutex>
#include <stdexcept>
#include <string>
#include <vector>

#include "registration/registrar.h"

namespace nerf_pose_refiner {

/// A model that was asked for, and where it came from.
struct RegisteredObject {
  std::shared_ptr<const Field> field;
  bool loaded_existing = false;    ///< nothing was trained
  std::vector<std::string> notes;  ///< @see Dataset::notes
};

/// What is reported to those who wait for a registration.
struct RegistrationUpdate {
  RegistrationProgress progress;           ///< without its `preview`
  std::vector<std::uint8_t> preview_jpeg;  ///< the newest one; empty: none was made yet
};

/// Another registration is under way; the text says which, and how far it is.
struct RegistrationBusy : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// The registrations of a process: one at a time, on a thread of its own. Who asks for the one that
/// is under way joins it. It is stopped when nobody waits for it any more.
class RegistrationQueue {
 public:
  using Progress = std::function<void(const RegistrationProgress&)>;

  struct Job {
    std::string name;  ///< of the object, for who is turned away
    std::string key;   ///< two jobs with one key are the same
    /// Does it, and owns all that it needs: who asked first may leave while others wait.
    std::function<RegisteredObject(const Progress&, const CancellationToken&)> work;
  };

  struct Listener {
    /// Called about twice a second in the thread that waits; must not throw; may be empty.
    std::function<void(const RegistrationUpdate&)> progress;
    /// Whether previews are used; called in any thread; empty: no. They are made seldom.
    std::function<bool()> wants_preview;
  };

  /// Does a job, or joins it, and waits for its end.
  /// @param cancellation leaves. The last who leaves stops the job and waits until it has ended.
  /// @throws RegistrationBusy, Cancelled, and what the job throws.
  RegisteredObject run(const Job& job, const Listener& listener,
                       const CancellationToken& cancellation);

 private:
  struct Running;

  std::shared_ptr<Running> join(const Job& job, const Listener& listener);
  static void work(Running* running, const Job& job);
  static bool previewIsWanted(Running* running);

  std::mutex mutex_;  ///< guards running_ and what it points to
  std::shared_ptr<Running> running_;
};

}  // namespace nerf_pose_refiner
