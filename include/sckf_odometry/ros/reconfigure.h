// Parameters that change while the node runs.
#pragma once

#include <dynamic_reconfigure/server.h>
#include <ros/node_handle.h>

#include <boost/thread/recursive_mutex.hpp>
#include <functional>

#include "sckf_odometry/ScKfOdometryConfig.h"
#include "sckf_odometry/ros/parameters.h"

namespace sckf {

/// The dynamic_reconfigure server of the parameters that parameterList() marks so. What parameters don't allow together
/// is refused with a warning, and the client sees the values that hold.
class Reconfigure {
 public:
  /// options: as they are now. apply: called with the changed ones, from the thread that serves the request.
  Reconfigure(const ros::NodeHandle& private_nh, const Options& options,
              const std::function<void(const Options&)>& apply);

 private:
  void onRequest(sckf_odometry::ScKfOdometryConfig& config);

  Options options_;
  std::function<void(const Options&)> apply_;
  boost::recursive_mutex mutex_;
  dynamic_reconfigure::Server<sckf_odometry::ScKfOdometryConfig> server_;
};

}  // namespace sckf
