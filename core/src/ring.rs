//! A queue of fixed capacity that compares by its contents.
//!
//! heapless's own comparison slices its buffers, which a linker cannot prove free of panics.

use heapless::Deque;

/// At most `N` items, oldest first.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(
    feature = "serde",
    serde(bound(
        serialize = "T: serde::Serialize",
        deserialize = "T: serde::Deserialize<'de>"
    ))
)]
pub(crate) struct Ring<T, const N: usize> {
    items: Deque<T, N>,
}

impl<T, const N: usize> Default for Ring<T, N> {
    fn default() -> Self {
        Self {
            items: Deque::new(),
        }
    }
}

impl<T: PartialEq, const N: usize> PartialEq for Ring<T, N> {
    fn eq(&self, other: &Self) -> bool {
        self.iter().eq(other.iter())
    }
}

impl<T, const N: usize> Ring<T, N> {
    /// Items, oldest first.
    pub(crate) fn iter(&self) -> impl DoubleEndedIterator<Item = &T> {
        self.items.iter()
    }

    /// Items from the first `later` one on; all after it must be so as well.
    pub(crate) fn since_first(&self, later: impl Fn(&T) -> bool) -> impl Iterator<Item = &T> {
        let (front, back) = self.items.as_slices();
        let from = |items: &[T]| items.partition_point(|item| !later(item));
        let (skipped, more) = (from(front), from(back));
        front.iter().skip(skipped).chain(back.iter().skip(more))
    }

    pub(crate) fn len(&self) -> usize {
        self.items.len()
    }

    pub(crate) fn oldest(&self) -> Option<&T> {
        self.items.front()
    }

    pub(crate) fn newest(&self) -> Option<&T> {
        self.items.back()
    }

    /// Takes the oldest item out.
    pub(crate) fn pop(&mut self) -> Option<T> {
        self.items.pop_front()
    }

    /// Adds the newest item; gives it back if there is no room.
    pub(crate) fn push(&mut self, item: T) -> Result<(), T> {
        self.items.push_back(item)
    }

    /// Adds the newest item, dropping the oldest for it if there is no room.
    pub(crate) fn push_over(&mut self, item: T) {
        if let Err(item) = self.items.push_back(item) {
            self.items.pop_front();
            // There is room now.
            let _ = self.items.push_back(item);
        }
    }
}
