//! Files as they are read and written.

mod advice;
mod contradicted_rates;
mod cut_files;
mod damaged_files;
mod grid;
mod held;
mod instruments;
mod lab_files;
mod misreadings;
mod other_files;
mod refused_recordings;
mod rivals;
mod rows_without_times;
mod sealed_records;
mod shifted_rows;
mod silent_misreadings;
mod spring_in_series;
mod temperature;
mod written_files;
mod wrong_readings;
