"""Models from measured frequency responses, and measured forces beside computed ones."""
