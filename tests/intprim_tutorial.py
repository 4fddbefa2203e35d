"""Every block of code of section 4.2 of the dissertation, in its order and as printed there; test_intprim_tutorial.py runs them.

What typesetting did is undone: lines broken within statements and comments, indentation lost and blocks cut in two at
the end of a page. What is mended beyond that has a comment at its line that begins with "printed". Figures stand where
the text has them.
"""

# %% 4.2.1 Basis Spaces (1)
import matplotlib.pyplot as plt
import numpy as np

# Import the library.
import intprim

# Set a seed for reproducibility
np.random.seed(213413414)

# Define the data axis names.
dof_names = np.array(["X", "Y"])

# Decompose the handwriting trajectories to a basis space with 8 uniformly distributed Gaussian functions and a variance of 0.1.
basis_model_gaussian = intprim.basis.GaussianModel(8, 0.1, dof_names)

basis_model_gaussian.plot()

# %% 4.2.1 Basis Spaces (2)
# Define some parameters used when generating synthetic data.
num_train_trajectories = 50
train_translation_mean = 0.0
train_translation_std = 5.0
train_noise_std = 0.01
train_length_mean = 95
train_length_std = 30

# Generate some synthetic handwriting trajectories.
training_trajectories = intprim.examples.create_2d_handwriting_data(
    num_train_trajectories,
    train_translation_mean,
    train_translation_std,
    train_noise_std,
    train_length_mean,
    train_length_std)

domain = np.linspace(0, 1, training_trajectories[0].shape[1], dtype = intprim.constants.DTYPE)
weights = basis_model_gaussian.fit_basis_functions_linear_closed_form(domain, training_trajectories[0].T).reshape(2, 8)
basis_model_gaussian.plot_weighted(weights, dof_names)

# %% 4.2.1 Basis Spaces (3)
basis_model_sigmoidal = intprim.basis.SigmoidalModel(8, 0.1, dof_names)

basis_model_sigmoidal.plot()

# %% 4.2.2 Choosing an Appropriate Basis Space (1)
selection = intprim.basis.Selection(dof_names)

for trajectory in training_trajectories:
    selection.add_demonstration(trajectory)

aic, bic = selection.get_information_criteria(np.array([0, 1], dtype = np.int32))
selection.get_best_model(aic, bic)

# %% 4.2.3 Using Multiple Basis Spaces (1)
basis_model_gaussian = intprim.basis.GaussianModel(8, 0.1, ["X"])
basis_model_sigmoidal = intprim.basis.SigmoidalModel(8, 0.1, ["Y"])
models = [basis_model_gaussian, basis_model_sigmoidal]

basis_model_mixture = intprim.basis.MixtureModel(models)

# %% 4.2.4 Computing Observation Noise (1)
observation_noise = np.diag(selection.get_model_mse(basis_model_mixture, np.array([0, 1])))

# %% 4.2.5 Scaling (1)
# Define a scaling group where both DoFs are scaled together.
scaling_groups_together = [
    [0, 1]
]

# Define a scaling group where the DoFs are scaled separately.
scaling_groups_separate = [
    [0],
    [1]
]

# Initialize a BIP instance.
primitive = intprim.BayesianInteractionPrimitive(basis_model_mixture, scaling_groups = scaling_groups_together)

# First compute the scaling
for trajectory in training_trajectories:
    primitive.compute_standardization(trajectory)

# Then add the demonstrations
for trajectory in training_trajectories:
    primitive.add_demonstration(trajectory)

# %% 4.2.5 Scaling (2)
selection = intprim.basis.Selection(dof_names, scaling_groups = scaling_groups_together)

for trajectory in training_trajectories:
    selection.add_demonstration(trajectory)

observation_noise = np.diag(selection.get_model_mse(basis_model_mixture, np.array([0, 1])))

# %% 4.2.6.1 Export (1)
primitive.export_data("some_file_name.bip")

# %% 4.2.6.2 Import (1)
primitive.import_data("some_file_name.bip")

# %% 4.2.7.1 Spatiotemporal Filters (1)
# Compute the phase mean and phase velocities from the demonstrations.
phase_velocity_mean, phase_velocity_var = intprim.examples.get_phase_stats(training_trajectories)
phase_mean = 0.0
phase_var = 1e-4

process_var = 1e-8

# Define the initial mean/variance of the temporal state.
initial_phase_mean = [phase_mean, phase_velocity_mean]
initial_phase_var = [phase_var, phase_velocity_var]

# %% 4.2.7.1 Spatiotemporal Filters (2)
# Define the initial mean/variance for a 0th order system.
initial_phase_mean = [phase_mean]
initial_phase_var = [phase_var]

# Arbitrarily choose acceleration values
phase_accel_mean = 1e-4
phase_accel_var = 1e-10

# Define the initial mean/variance for a 2nd order system.
initial_phase_mean = [phase_mean, phase_velocity_mean, phase_accel_mean]
initial_phase_var = [phase_var, phase_velocity_var, phase_accel_var]

# %% 4.2.7.1 Spatiotemporal Filters (3)
# Initialize an ensemble Kalman filter
filter_enkf = intprim.filter.spatiotemporal.EnsembleKalmanFilter(
    basis_model = basis_model_mixture,
    initial_phase_mean = initial_phase_mean,
    initial_phase_var = initial_phase_var,
    proc_var = process_var,
    initial_ensemble = primitive.basis_weights)

# %% 4.2.7.1 Spatiotemporal Filters (4)
import sklearn.mixture

ensemble_sampler = sklearn.mixture.GaussianMixture(n_components = 2, reg_covar = 1e-4)
ensemble_sampler.fit(primitive.basis_weights)

sampled_ensemble = ensemble_sampler.sample(num_train_trajectories)[0]

# Initialize an ensemble Kalman filter
filter_enkf = intprim.filter.spatiotemporal.EnsembleKalmanFilter(
    basis_model = basis_model_mixture,
    initial_phase_mean = initial_phase_mean,
    initial_phase_var = initial_phase_var,
    proc_var = 1e-8,
    initial_ensemble = sampled_ensemble)

# %% 4.2.7.1 Spatiotemporal Filters (5)
# Calculate sample mean and covariance of demonstrations
mean, cov = primitive.get_basis_weight_parameters()

# Initialize an extended Kalman filter
filter_ekf = intprim.filter.spatiotemporal.ExtendedKalmanFilter(
    basis_model = basis_model_mixture,
    initial_phase_mean = initial_phase_mean,
    initial_phase_var = initial_phase_var,
    proc_var = 1e-8,
    mean_basis_weights = mean,
    cov_basis_weights = cov)

# %% 4.2.7.1 Spatiotemporal Filters (6)
# Initialize a particle filter
filter_pf = intprim.filter.spatiotemporal.ParticleFilter(
    basis_model = basis_model_mixture,
    initial_phase_mean = initial_phase_mean,
    initial_phase_var = initial_phase_var,
    proc_var = process_var,
    initial_ensemble = primitive.basis_weights,
    num_effective_ratio = 0.5)

# %% 4.2.7.2 Spatial Filters (1)
# Initialize a Kalman filter
filter_kf = intprim.filter.KalmanFilter(
    basis_model = basis_model_mixture,
    mean_basis_weights = mean,
    cov_basis_weights = cov,
    align_func = intprim.filter.align.dtw.fastdtw,
    iterative_alignment = False)

# %% 4.2.7.3 Cyclical Filtering (1)
# Initialize an ensemble Kalman filter
filter_enkf = intprim.filter.spatiotemporal.EnsembleKalmanFilter(
    basis_model = basis_model_mixture,
    initial_phase_mean = initial_phase_mean,
    initial_phase_var = initial_phase_var,
    proc_var = process_var,
    initial_ensemble = primitive.basis_weights,
    cyclical = True)

# %% 4.2.8 Inference (1)
import copy

##### Initialize the BIP instance #####

# Define a scaling group where both DoFs are scaled together.
scaling_groups_together = [
    [0, 1]
]

# Use the model that we found during selection earlier.
basis_model_gaussian = intprim.basis.GaussianModel(9, 0.1, dof_names)

# Initialize a BIP instance.
primitive = intprim.BayesianInteractionPrimitive(basis_model_gaussian, scaling_groups = scaling_groups_together)

# First compute the scaling.
for trajectory in training_trajectories:
    primitive.compute_standardization(trajectory)

# Then add the demonstrations.
for trajectory in training_trajectories:
    primitive.add_demonstration(trajectory)

##### Determine the observation noise #####

selection = intprim.basis.Selection(dof_names, scaling_groups = scaling_groups_together)

for trajectory in training_trajectories:
    selection.add_demonstration(trajectory)

# Get the observation noise. Note that it is much smaller than train_noise_std^2 because we have scaled the values between [0, 1].
observation_noise = np.diag(selection.get_model_mse(basis_model_gaussian, np.array([0, 1])))

##### Create a test trajectory #####

num_test_trajectories = 1
test_translation_mean = -10.0
test_translation_std = 1e-5
test_noise_std = 0.01
test_length_mean = 145
test_length_std = 1e-5

# Create test trajectories.
test_trajectories = intprim.examples.create_2d_handwriting_data(
    num_test_trajectories,
    test_translation_mean,
    test_translation_std,
    test_noise_std,
    test_length_mean,
    test_length_std)

# Explicitly zero out the x-axis values to illustrate that they are not being used.
test_trajectory_partial = np.array(test_trajectories[0], copy = True)
test_trajectory_partial[0, :] = 0.0

# We must make sure to inflate the corresponding observation noise entry as well so we ignore the zero values.
observation_noise[0, 0] = 10000.0

# Define the active DoF to only be the y-axis.
active_dofs = np.array([1])

##### Create a filter for inference #####

# Compute the phase mean and phase velocities from the demonstrations.
phase_velocity_mean, phase_velocity_var = intprim.examples.get_phase_stats(training_trajectories)
phase_mean = 0.0
phase_var = 1e-4

process_var = 1e-8

# Define the initial mean/variance of the temporal state.
initial_phase_mean = np.array([phase_mean, phase_velocity_mean])
initial_phase_var = np.array([phase_var, phase_velocity_var])

# Initialize an ensemble Kalman filter.
filter_enkf = intprim.filter.spatiotemporal.EnsembleKalmanFilter(  # printed as filter_ekf
    basis_model = basis_model_gaussian,
    initial_phase_mean = initial_phase_mean,
    initial_phase_var = initial_phase_var,
    proc_var = process_var,
    initial_ensemble = primitive.basis_weights)

##### Initialize the BIP instance for inference #####

# Set the filter using a deep copy that way we can re-use the filter for inference multiple times without having to re-create it from scratch.
# This is simply for convenience.
primitive.set_filter(copy.deepcopy(filter_enkf))

##### Perform inference and plot the results #####

# Calculate the mean trajectory for plotting.
mean_trajectory = primitive.get_mean_trajectory()

prev_observed_index = 0
for observed_index in range(32, test_trajectory_partial.shape[1], 32):
    # Perform inference over the test trajectory in batches of 32 samples, just so we can clearly plot how the inference changes over time.
    # In practice, you can pass as many or as few observations at a time as desired.
    inferred_trajectory, phase, mean, var = primitive.generate_probable_trajectory_recursive(
        test_trajectory_partial[:, prev_observed_index:observed_index],
        observation_noise,
        active_dofs,
        num_samples = test_trajectory_partial.shape[1] - observed_index)

    prev_observed_index = observed_index

    # Plot the results as we go.
    intprim.util.visualization.plot_partial_trajectory(inferred_trajectory, test_trajectories[0][:, :observed_index], mean_trajectory)

# %% 4.2.8 Inference (2)
##### Create a test trajectory #####

num_test_trajectories = 1
test_translation_mean = -10.0
test_translation_std = 1e-5
test_noise_std = 0.08
test_length_mean = 145
test_length_std = 1e-5

# Create test trajectories.
test_trajectories = intprim.examples.create_2d_handwriting_data(
    num_test_trajectories,
    test_translation_mean,
    test_translation_std,
    test_noise_std,
    test_length_mean,
    test_length_std)

# Explicitly zero out the x-axis values to illustrate that they are not being used.
test_trajectory_partial = np.array(test_trajectories[0], copy = True)
test_trajectory_partial[0, :] = 0.0

##### Initialize the BIP instance for inference #####

# Set the filter using a deep copy that way we can re-use the filter for inference multiple times without having to re-create it from scratch.
# This is simply for convenience.
primitive.set_filter(copy.deepcopy(filter_enkf))

##### Perform inference and plot the results #####

# Calculate the mean trajectory for plotting.
mean_trajectory = primitive.get_mean_trajectory()

prev_observed_index = 0
for observed_index in range(32, test_trajectory_partial.shape[1], 32):
    # Perform inference over the test trajectory in batches of 32 samples, just so we can clearly plot how the inference changes over time.
    # In practice, you can pass as many or as few observations at a time as desired.
    inferred_trajectory, phase, mean, var = primitive.generate_probable_trajectory_recursive(
        test_trajectory_partial[:, prev_observed_index:observed_index],
        observation_noise,
        active_dofs,
        num_samples = test_trajectory_partial.shape[1] - observed_index)

    prev_observed_index = observed_index

    # Plot the results as we go.
    intprim.util.visualization.plot_partial_trajectory(inferred_trajectory, test_trajectories[0][:, :observed_index], mean_trajectory)

# %% 4.2.8.1 Inferred Trajectory Length (1)
##### Initialize the BIP instance for inference #####

# Set the filter using a deep copy that way we can re-use the filter for inference multiple times without having to re-create it from scratch.
# This is simply for convenience.
primitive.set_filter(copy.deepcopy(filter_enkf))

##### Perform inference and plot the results #####

# Calculate the mean trajectory for plotting.
mean_trajectory = primitive.get_mean_trajectory()

prev_observed_index = 0
for observed_index in range(32, test_trajectory_partial.shape[1], 32):
    num_samples = np.max([2, (test_trajectory_partial.shape[1] - observed_index) / 20])

    # Perform inference over the test trajectory in batches of 32 samples, just so we can clearly plot how the inference changes over time.
    # In practice, you can pass as many or as few observations at a time as desired.
    inferred_trajectory, phase, mean, var = primitive.generate_probable_trajectory_recursive(
        test_trajectory_partial[:, prev_observed_index:observed_index],
        observation_noise,
        active_dofs,
        num_samples = num_samples)

    prev_observed_index = observed_index

    # Plot the results as we go.
    intprim.util.visualization.plot_partial_trajectory(inferred_trajectory, test_trajectories[0][:, :observed_index], mean_trajectory)

# %% 4.2.8.2 Starting Phase (1)
##### Create a test trajectory #####

num_test_trajectories = 1
test_translation_mean = -10.0
test_translation_std = 1e-5
test_noise_std = 0.01
test_length_mean = 45
test_length_std = 1e-5

# Create test trajectories.
test_trajectories = intprim.examples.create_2d_handwriting_data(
    num_test_trajectories,
    test_translation_mean,
    test_translation_std,
    test_noise_std,
    test_length_mean,
    test_length_std)

# Explicitly zero out the x-axis values to illustrate that they are not being used.
test_trajectory_partial = np.array(test_trajectories[0], copy = True)
test_trajectory_partial[0, :] = 0.0

##### Initialize the BIP instance for inference #####

# Set the filter using a deep copy that way we can re-use the filter for inference multiple times without having to re-create it from scratch.
# This is simply for convenience.
primitive.set_filter(copy.deepcopy(filter_enkf))

##### Perform inference and plot the results #####

# Calculate the mean trajectory for plotting.
mean_trajectory = primitive.get_mean_trajectory()

prev_observed_index = 0
for observed_index in range(16, test_trajectory_partial.shape[1], 16):
    # Perform inference over the test trajectory in batches of 16 samples, just so we can clearly plot how the inference changes over time.
    # In practice, you can pass as many or as few observations at a time as desired.
    inferred_trajectory, phase, mean, var = primitive.generate_probable_trajectory_recursive(
        test_trajectory_partial[:, prev_observed_index:observed_index],
        observation_noise,
        active_dofs,
        num_samples = test_trajectory_partial.shape[1],
        starting_phase = 0.0)

    prev_observed_index = observed_index

    # Plot the results as we go.
    intprim.util.visualization.plot_partial_trajectory(inferred_trajectory, test_trajectories[0][:, :observed_index], mean_trajectory)

# %% 4.2.8.2 Starting Phase (2)
##### Initialize the BIP instance for inference #####

# Set the filter using a deep copy that way we can re-use the filter for inference multiple times without having to re-create it from scratch.
# This is simply for convenience.
primitive.set_filter(copy.deepcopy(filter_enkf))

##### Perform inference and plot the results #####

# Calculate the mean trajectory for plotting.
mean_trajectory = primitive.get_mean_trajectory()

prev_observed_index = 0
for observed_index in range(16, test_trajectory_partial.shape[1], 16):
    # Perform inference over the test trajectory in batches of 16 samples, just so we can clearly plot how the inference changes over time.
    # In practice, you can pass as many or as few observations at a time as desired.
    inferred_trajectory, phase, mean, var = primitive.generate_probable_trajectory_recursive(
        test_trajectory_partial[:, prev_observed_index:observed_index],
        observation_noise,
        active_dofs,
        num_samples = test_trajectory_partial.shape[1],
        starting_phase = 0.7)

    prev_observed_index = observed_index

    # Plot the results as we go.
    intprim.util.visualization.plot_partial_trajectory(inferred_trajectory, test_trajectories[0][:, :observed_index], mean_trajectory)

# %% 4.2.8.3 Phase Lookahead (1)
##### Initialize the BIP instance for inference #####
# Set the filter using a deep copy that way we can re-use the filter for inference multiple times without having to re-create it from scratch.
# This is simply for convenience.
primitive.set_filter(copy.deepcopy(filter_enkf))

##### Perform inference and plot the results #####

# Calculate the mean trajectory for plotting.
mean_trajectory = primitive.get_mean_trajectory()

prev_observed_index = 0
for observed_index in range(16, test_trajectory_partial.shape[1], 16):
    # Perform inference over the test trajectory in batches of 16 samples, just so we can clearly plot how the inference changes over time.
    # In practice, you can pass as many or as few observations at a time as desired.
    inferred_trajectory, phase, mean, var = primitive.generate_probable_trajectory_recursive(
        test_trajectory_partial[:, prev_observed_index:observed_index],
        observation_noise,
        active_dofs,
        num_samples = test_trajectory_partial.shape[1] - observed_index,
        phase_lookahead = 0.1)

    prev_observed_index = observed_index

    # Plot the results as we go.
    intprim.util.visualization.plot_partial_trajectory(inferred_trajectory, test_trajectories[0][:, :observed_index], mean_trajectory)

# %% 4.2.9.1 Exporting Analysis File (1)
##### Initialize the BIP instance for inference #####

# Set the filter using a deep copy that way we can re-use the filter for inference multiple times without having to re-create it from scratch.
# This is simply for convenience.
primitive.set_filter(copy.deepcopy(filter_enkf))

##### Initialize StatCollector #####

# We need to specify which DoFs we want to infer trajectories for...
generated_indices = np.array([0])
# ...and which we are observing but not inferring. In this example, there is no difference.
observed_indices = np.array([1])

stat_collector = intprim.util.StatCollector(primitive, generated_indices, observed_indices)

##### Perform inference and export the analysis file #####

# Calculate the mean trajectory for plotting.
mean_trajectory = primitive.get_mean_trajectory(num_samples = test_trajectory_partial.shape[1])

# Call collect once before inference starts, to capture the initial state of the filter.
# It is important that timestamp = None here and the observed trajectory is empty for visualization to properly function.
# Note that we must transpose the trajectories that are collected.
stat_collector.collect(
    primitive,
    np.array([[[] for _ in range(mean_trajectory.shape[0])]]),  # printed with one ] less
    mean_trajectory.T,
    timestamp = None)

prev_observed_index = 0
for observed_index in range(1, test_trajectory_partial.shape[1], 1):
    # Perform inference over the test trajectory in batches of 1 samples, just so we can clearly plot how the inference changes over time.
    # In practice, you can pass as many or as few observations at a time as desired.
    inferred_trajectory, phase, mean, var = primitive.generate_probable_trajectory_recursive(
        test_trajectory_partial[:, prev_observed_index:observed_index],
        observation_noise,
        active_dofs,
        num_samples = test_trajectory_partial.shape[1] - observed_index)

    # Pass stat collector the necessary information. Note that the timestamp will be used to sequence calls.
    # In real experimens, this is typically a clock timestamp.
    stat_collector.collect(
        primitive,
        test_trajectories[0][:, prev_observed_index:observed_index].T,
        inferred_trajectory.T,
        timestamp = observed_index)

    prev_observed_index = observed_index

# Export the analysis file
stat_collector.export(
    primitive,
    export_dir_path = ".", # The directory in which to save the analysis file
    debug_bag_file = "", # If experiment is conducted from a rosbag file, this can be indicated here. Discussed more in intprim_ros_framework.
    response_length = test_trajectory_partial.shape[1], # The maximum length of the inferred trajectory
    use_spt = False, # True if num_samples has been set to 1 to only generate a single state
    spt_phase = None # If use_spt is True, the starting_phase.
)
