//! Clone, Debug and PartialEq of states that hold a memory's history.

/// Implements the three for a state where the history has them. `derive` would ask them of the memory instead.
macro_rules! state_traits {
    ($State:ident<T, M $(, $SIZE:ident)?> { $($field:ident),+ $(,)? }) => {
        impl<T: Scalar, M: Memory<T> $(, const $SIZE: usize)?> Clone for $State<T, M $(, $SIZE)?>
        where
            M::History: Clone,
        {
            fn clone(&self) -> Self {
                Self { $($field: self.$field.clone()),+ }
            }
        }

        impl<T: Scalar, M: Memory<T> $(, const $SIZE: usize)?> core::fmt::Debug for $State<T, M $(, $SIZE)?>
        where
            M::History: core::fmt::Debug,
        {
            fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
                f.debug_struct(stringify!($State))$(.field(stringify!($field), &self.$field))+.finish()
            }
        }

        impl<T: Scalar + PartialEq, M: Memory<T> $(, const $SIZE: usize)?> PartialEq for $State<T, M $(, $SIZE)?>
        where
            M::History: PartialEq,
        {
            fn eq(&self, other: &Self) -> bool {
                $(self.$field == other.$field)&&+
            }
        }
    };
}

pub(crate) use state_traits;
