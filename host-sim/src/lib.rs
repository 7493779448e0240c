pub mod full_memory;
