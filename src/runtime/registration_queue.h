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

/// The model of a registration, and whether it was trained.
struct RegisteredObject {
  std::shared_ptr<const Field> field;
  bool loaded_existing = false;    ///< nothing was trained
  std::vector<std::string> notes;  ///< @see Dataset::notes
};

/// A progress report to the callers that wait for a registration.
struct RegistrationUpdate {
  RegistrationProgress progress;           ///< without its `preview`
  std::vector<std::uint8_t> preview_jpeg;  ///< the newest preview; empty: none yet
};

/// Another registration is running; the message names it and its progress.
struct RegistrationBusy : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// Runs the registrations of a process, one at a time, on a thread of their own. A request that is
/// identical to the running one joins it. A job is cancelled when no caller waits for it any more.
class RegistrationQueue {
 public:
  using Progress = std::function<void(const RegistrationProgress&)>;

  struct Job {
    std::string name;  ///< of the object, for messages to callers that are refused
    std::string key;   ///< jobs with the same key are identical
    /// Does the job. It owns all that it needs: the first caller may leave while others wait.
    std::function<RegisteredObject(const Progress&, const CancellationToken&)> work;
  };

  struct Listener {
    /// Called about twice a second in the waiting thread; must not throw; may be empty.
    std::function<void(const RegistrationUpdate&)> progress;
    /// Whether somebody looks at previews; called in any thread; empty: no.
    std::function<bool()> wants_preview;
  };

  /// Runs a job, or joins the identical one that is running, and waits for its end.
  /// @param cancellation makes this call leave. The last caller to leave cancels the job and waits
  /// until it has ended.
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
